#!/usr/bin/env bash
# Installs, builds and tests; .ci/run calls it with --all.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/test.sh [--all | [--lint] [--core] [--kernel] [--node] [--ros] [--sanitize] [--bad-days]
                       [--soak] [--fuzz] [--arm64]]

Installs missing packages, builds, and runs the named stages. Without an option it runs those that most
changes need, --ros and --core without their longest searches: about a quarter of an hour on two processors.

  --all   everything below but --soak, with the longest searches and the benchmarks of --core
  --lint  clang-format, clang-tidy and shellcheck on the project's own files; doxygen on the public
          headers; the keys of package.xml; the links of the pages, and the files that they name; the table of
          their commands; the tests that docs/reliability.md names; the spelling
  --core  stepdriver_core and its tests, built alone, as on a machine without ROS, its Python package, and
          programs that use the installed library; the pictures of docs/motion.md drawn with this build
  --kernel  the GPIO backends, and whole machines, on a separate kernel with simulated GPIO chips
          (test/kernel), with each libgpiod of this Debian; with --node also the whole node on that kernel's
          GPIO chips; includes --core
  --node  the catkin package and its rostests
  --ros   the same, its install space with all commands and the service, which other computers can reach
          the node, a package that depends on it, and the trace of a move, read by sigrok-cli; the commands
          of the pages
  --sanitize  some tests of the core with AddressSanitizer and UndefinedBehaviorSanitizer, and with
          ThreadSanitizer; a node with the latter in a storm of requests
  --bad-days  floods of clients against a node (test/bad_days), for two seconds each
  --soak  the same for a minute each
  --fuzz  random inputs for everything that reads files, messages and commands (scripts/fuzz.sh)
  --arm64  some tests of the core as a Raspberry Pi with 64 bits runs them, under an emulator, and the
          times of its steps, which must be those of this computer; a whole emulated machine that moves an
          axis by libgpiod (scripts/cross.sh)

The last lines are a table of the stages with their times. A stage has parts; if one of them fails, the others
still run, and the table names it. Exit code 0: nothing failed.
END
}

everything=(lint core kernel ros sanitize bad-days fuzz arm64)
wanted=() thorough='' flood_seconds=2
for argument; do
  case $argument in
    --all) wanted+=("${everything[@]}") thorough=ON ;;
    --soak) wanted+=(bad-days) flood_seconds=60 ;;
    --lint | --core | --kernel | --node | --ros | --sanitize | --bad-days | --fuzz | --arm64) wanted+=("${argument#--}") ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
  esac
done
((${#wanted[@]} > 0)) || wanted=(core ros)
wants() { [[ " ${wanted[*]} " == *" $1 "* ]]; }
! wants kernel || wants core || wanted+=(core)
! wants ros || wants node || wanted+=(node)

# ---- stages ----

declare -A outcome parts_that
summary='' stage='' stage_start=0
stages_passed=0 stages_failed=0 stages_skipped=0
failed_parts=()
# A part that can't run here ends with this status, and writes its reason to log/skipped.
skip_status=77
skip() {
  say "$*" >"$build/log/skipped"
  exit "$skip_status"
}

# timed NAME FUNCTION: in a shell of its own, which writes the times of the processor, its own and that of
# the programs that it ran, to log/NAME.times when it ends.
timed() {
  # shellcheck disable=SC2064  # this name, not that of a function called from here
  trap "times >'$build/log/$1.times'" EXIT
  "$2"
  exit  # bash 5.0 forgets the trap without it
}
# kept NAME FUNCTION: the same, and what it prints is also kept in log/NAME.log.
kept() { timed "$1" "$2" 2>&1 | tee "$build/log/$1.log"; }
# processor_seconds PATTERN: the sum of the times in log/PATTERN.times.
processor_seconds() {
  # shellcheck disable=SC2086  # the pattern may match several, or none
  (cat "$build/log"/$1.times 2>/dev/null || true) |
    awk -F '[ms ]+' '{ sum += 60 * ($1 + $3) + $2 + $4 } END { printf "%.0f", sum }'
}

# stage NAME: ends the previous stage; the parts that follow belong to this one.
stage() {
  end_stage
  stage=$1 stage_start=$SECONDS
  parts_that=()
  say "" "==== $stage"
}
# part NAME FUNCTION [NEEDED...]: runs a function as a part of the stage, unless a part that it needs, of any
# stage ("core build"), didn't pass.
part() {
  local name=$1 function=$2 needed log=stage-$stage-$1
  for needed in "${@:3}"; do
    [[ ${outcome[$needed]:-} != passed ]] || continue
    parts_that[waited]+=" $name"
    return
  done
  say "---- $stage: $name"
  run kept "$log" "$function"
  if ((run_status == 0)); then
    outcome[$stage $name]=passed
    parts_that[passed]+=" $name"
  elif ((run_status == skip_status)); then
    parts_that[skipped]+="; without $name: $(tail -n 1 "$build/log/skipped")"
  else
    parts_that[failed]+=" $name"
    failed_parts+=("$log")
  fi
}
# Writes the row of the stage into the table.
end_stage() {
  local result=passed note
  [[ -n $stage ]] || return 0
  note="${parts_that[failed]:+; failed:${parts_that[failed]}}${parts_that[waited]:+; not run:${parts_that[waited]}}"
  note+=${parts_that[skipped]:-}
  if [[ -n ${parts_that[failed]:-} ]]; then
    result=FAILED
    stages_failed=$((stages_failed + 1))
  elif [[ -n ${parts_that[passed]:-} ]]; then
    stages_passed=$((stages_passed + 1))
  else
    result=skipped
    stages_skipped=$((stages_skipped + 1))
  fi
  summary+=$(printf '%-12s %-8s %5d s %7d s  %s' "$stage" "$result" "$((SECONDS - stage_start))" \
    "$(processor_seconds "stage-$stage-*")" "${note#; }")$'\n'
  stage=''
}
# The findings of a part that failed, and its end, for a reader of the last lines of all output.
show_failure() {
  local log=$build/log/$1.log
  say "" "==== why $1 failed ($log)"
  grep -E -A 10 "$signs_of_failure" "$log" | head -n 50 || true
  say "---- its end"
  tail -n 20 "$log"
}
signs_of_failure=': Failure$|[*]{3}(Failed|Exception|Timeout)|\[FAILURE\]|(Thread|Address)Sanitizer:|runtime error:| error: '

# clang-tidy and the builds with sanitizers take longest. They run in the background with low priority,
# one after the other, once the core is tested: many of the other tests leave them a processor. The part that
# needs one waits for its end.
background_group=
begin_background() {
  (($# > 0)) || return 0
  rm -f "$build"/log/background-*.{status,times}
  set -m
  (
    set +m
    renice -n 19 -p "$BASHPID" >/dev/null
    for function; do
      status=0
      (set -e; timed "background-$function" "$function") >"$build/log/background-$function.log" 2>&1 &
      wait "$!" || status=$?
      say "$status" >"$build/log/background-$function.status"
    done
  ) </dev/null &
  set +m
  background_group=$!
}
# await FUNCTION: shows its output if it failed.
await() {
  local log=$build/log/background-$1
  while [[ ! -s $log.status ]] && kill -0 "$background_group" 2>/dev/null; do sleep 1; done
  [[ $(cat "$log.status" 2>/dev/null) != 0 ]] || return 0
  [[ ! -f $log.log ]] || tail -n 200 "$log.log"
  return 1
}
end_background() { [[ -z $background_group ]] || end_group "$background_group" 5; }
at_exit end_background

# The project's own files that match the given patterns, as paths in the checkout.
own_files() {
  local pattern names=()
  if git -C "$root" rev-parse --is-inside-work-tree >/dev/null 2>&1; then
    (cd "$root" && git ls-files --cached --others --exclude-standard -- "$@") |
      while IFS= read -r name; do [[ ! -f $root/$name ]] || say "$name"; done
  else
    (($# > 0)) || set -- '*'
    for pattern; do names+=(-o -name "$pattern"); done
    (cd "$root" && find . -type d '(' -name build -o -name 'build-*' -o -name '.?*' ')' -prune \
      -o -type f '(' "${names[@]:1}" ')' -print) | sed 's|^\./||' | sort
  fi
}

# The format and the findings are those of Debian 12's clang; other versions differ.
has_clang_14() { [[ $(clang-format --version) == *' 14.'* ]]; }
needs_clang_14() { has_clang_14 || skip "needs clang 14, which Debian 12 has"; }

check_format() {
  needs_clang_14
  own_files '*.cpp' '*.h' | (cd "$root" && xargs -d '\n' clang-format --dry-run -Werror)
}

check_shell() {
  (cd "$root" && shellcheck -x scripts/*.sh bench/*.sh test/kernel/*.sh test/library/*.sh \
    test/operations/*.sh test/python/*.sh .ci/run)
}

check_packages() { /usr/bin/python3 -B "$root/test/docs/packages_test.py"; }
check_command_table() { /usr/bin/python3 -B "$root/test/docs/command_table_test.py"; }
check_links() { /usr/bin/python3 -B "$root/test/docs/links_test.py"; }
check_reliability() { /usr/bin/python3 -B "$root/test/docs/reliability_test.py"; }
check_spelling() {
  # The inputs in test/fuzz/corpus are no prose.
  own_files | grep -v '^test/fuzz/corpus/' | (cd "$root" && xargs -d '\n' codespell --ignore-words=test/docs/spelling.txt)
}
check_doxygen() { bash "$root/scripts/doxygen.sh"; }

# Checks each file with the compile commands of the build that compiles it. Only the adapter for the
# installed version of libgpiod is compiled.
tidy_all() {
  in_group=1 quietly tidy-configure configure_tidy || return 1
  local status=0 together=--checks=-bugprone-suspicious-include  # a file of several includes .cpp files
  own_files '*.cpp' | grep -E '^(stepdriver_core|bench|test/core|test/kernel|test/bad_days/soak)/' |
    compiled_alone_by core | tidy core || status=1
  own_files '*.cpp' | grep -E '^(stepdriver_ros|test/node|test/check|test/console|test/joystick|test/base|test/docs)/|^test/bad_days/[^/]*$' |
    compiled_alone_by catkin | tidy catkin || status=1
  compiled_together_by core | tidy core "$together" || status=1
  compiled_together_by catkin | grep -vF /catkin/stepdriver_core/ | tidy catkin "$together" || status=1
  return "$status"
}
# Several files are read as one, as most of the time goes to the headers. clang can't read the headers
# that gcc has precompiled.
configure_tidy() {
  local options=("$strict" -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON)
  configure "$src/stepdriver_core" "$build/tidy/core" "${options[@]}" -DSTEPDRIVER_BENCH=ON "$(python_option)" &&
    configure "$src" "$build/tidy/catkin" "${options[@]}" -DPYTHON_EXECUTABLE=/usr/bin/python3 &&
    cmake --build "$build/tidy/catkin" -j "$jobs" --target stepdriver_generate_messages_cpp &&
    cp "$src/.clang-tidy" "$build/tidy/" &&
    cp "$src/test/.clang-tidy" "$build/tidy/core/test/" &&
    cp "$src/test/.clang-tidy" "$build/tidy/catkin/test/"
}
# Those of the files on standard input that no other file includes.
compiled_alone_by() {
  local name
  while IFS= read -r name; do
    if grep -qF "\"file\": \"$src/$name\"" "$build/tidy/$1/compile_commands.json" &&
      ! compiled_together_by "$1" | xargs -d '\n' grep -qF "#include \"$src/$name\""; then
      say "$src/$name"
    fi
  done
}
compiled_together_by() {
  sed -nE 's|^ *"file": "(.*/Unity/[^"]*)".*|\1|p' "$build/tidy/$1/compile_commands.json"
}
# tidy BUILD [OPTION...]: the files on standard input.
# clang doesn't know all of gcc's options.
tidy() {
  local name=$1
  shift
  /usr/bin/python3 -B "$root/scripts/tidy.py" "$build/tidy/$name" "$@" \
    --extra-arg={-Wno-unknown-warning-option,-Qunused-arguments} \
    --header-filter="^$src/(stepdriver_core|stepdriver_ros|bench|test)/"
}

check_tidy() {
  needs_clang_14
  await tidy_all
}

# Ubuntu 20.04 has an older pybind11.
python_option() {
  local version
  version=$(dpkg-query -W -f='${Version}' pybind11-dev 2>/dev/null) || true
  if dpkg --compare-versions "$version" ge 2.10; then
    say -DSTEPDRIVER_PYTHON=ON
  else
    say -DSTEPDRIVER_PYTHON=OFF
  fi
}
build_core() {
  quietly core-build build_core_quietly
}
build_core_quietly() {
  configure_core "$strict" "-DSTEPDRIVER_BENCH=${thorough:-OFF}" "$(python_option)" &&
    cmake --build "$build/core" -j "$jobs"
}
# The search takes more than half of the time of all these tests: usually it plays a part of its schedules.
test_core() {
  local usual=()
  [[ -n $thorough ]] || usual=(--exclude-regex ForEachPairOfRequests)
  (cd "$build/core" && ctest -j "$jobs" --timeout 300 --no-tests=error --output-on-failure "${usual[@]}")
}

check_pictures() { bash "$root/scripts/motion_pictures.sh" --check; }

test_kernel() {
  local reason status=0
  say "Building the kernel (about five minutes the first time)"
  reason=$(bash "$src/test/kernel/run.sh" --check 2>&1) || status=$?
  ((status != skip_status)) || skip "$reason"
  ((status == 0)) || die "$reason"
  bash "$src/test/kernel/rig_test.sh" "$build/core/test/kernel/trace_to_vcd"
  STEPDRIVER_GPIO_SIM=1 bash "$src/test/kernel/run.sh" --chip rig:rig:8 -- \
    bash "$src/test/operations/udev_test.sh"
  # On this kernel, memory may be locked.
  in_kernel -- "$build/core/test/core/pulse_thread_calls_test" --gtest_filter='*NoMemoryThatIsMissing'
  test_lines_in_kernel "$build/core"
  # Pseudo terminals and the SPI bus of the drivers' registers.
  in_kernel -- "$build/core/test/core/bus_tests" --gtest_filter='SerialPort*:Spidev*'
  in_kernel --spi -- "$build/core/test/kernel/spidev_test"
  test_waveform_in_kernel "$build/core"
}
test_lines_in_kernel() {
  STEPDRIVER_GPIO_SIM=1 bash "$src/test/kernel/run.sh" --timeout 300 -- "$1/test/core/gpio_tests" \
    --gtest_filter='*LinesConformance.*:Libgpiod*'
}

build_for_kernel() { quietly kernel-build cmake --build "$build/core" -j "$jobs" --target kernel_programs; }

# Runs whole machines on that kernel, and compares their pulses with the kernel's own trace.
test_waveform_in_kernel() {
  local tests=$1/test/kernel traces=$1/traces run
  rm -rf "$traces"
  in_kernel -- "$tests/write_cost"
  in_kernel --timeout 300 -- "$tests/machine_waveform_test"
  for run in 1 2; do
    mkdir -p "$traces/$run"
    STEPDRIVER_TRACES=$traces/$run in_kernel --timeout 300 --time-travel -- "$tests/step_times_test"
  done
  diff -r "$traces/1" "$traces/2" >/dev/null || die "two runs in virtual time differ: see $traces"
  say "Both runs have the same trace, to the nanosecond."
}
in_kernel() {
  STEPDRIVER_GPIO_SIM=1 bash "$src/test/kernel/run.sh" "$@" | tee "$build/log/in-kernel.log"
  ! grep -qF '[  SKIPPED ]' "$build/log/in-kernel.log" || die "tests that must run on the test kernel were skipped"
}

# The same tests with libgpiod 2, if the system's version is 1.
test_kernel_gpiod2() {
  local unpacked status=0
  unpacked=$(bash "$src/scripts/libgpiod2.sh" 2>"$build/log/libgpiod2.log") || status=$?
  ((status != skip_status)) || skip "$(<"$build/log/libgpiod2.log")"
  ((status == 0)) || die "$(<"$build/log/libgpiod2.log")"
  [[ -n $unpacked ]] || skip "this Debian's own libgpiod is 2"
  quietly gpiod2-build build_gpiod2 "$unpacked"
  test_lines_in_kernel "$build/gpiod2"
  # What is above the lines doesn't depend on the library.
  in_kernel -- "$build/gpiod2/test/kernel/write_cost"
  in_kernel --time-travel -- "$build/gpiod2/test/kernel/step_times_test"
}
build_gpiod2() {
  cmake -S "$src/stepdriver_core" -B "$build/gpiod2" "${build_type[@]}" "$strict" \
    -DSTEPDRIVER_GPIOD=2 -DSTEPDRIVER_GPIOD_ROOT="$1" &&
    cmake --build "$build/gpiod2" -j "$jobs" --target gpio_tests step_times_test write_cost
}

build_node() {
  quietly node-build build_catkin "$strict" &&
    quietly node-tests-build cmake --build "$build/catkin" -j "$jobs" --target tests
}
test_node() {
  # Most of them wait for a node or for the rig, which moves in real time.
  (cd "$build/catkin" && ctest -j "$((2 * jobs))" --timeout 600 --no-tests=error --output-on-failure)
}

# The shipped launch and configuration files on a chip whose lines have a Raspberry Pi's names, and other
# nodes of the tests on chips of their own. The kernel's trace stays with the logs; the part of the
# launched node is compared with its chip's times. It runs at 1600 steps/s at most, and a late step takes
# up to a quarter of the interval after it.
test_node_in_kernel() {
  local offset lines='' trace=$build/log/kernel-node.trace header=pinctrl-bcm2711
  for offset in {2..27}; do lines+=",$offset=GPIO$offset"; done
  use_ros "$build/catkin/devel"
  STEPDRIVER_GPIO_SIM=1 bash "$src/test/kernel/run.sh" --timeout 300 \
    --chip "header:$header:58:${lines#,}" --trace "$trace" -- \
    rostest "$src/test/node/hardware/hardware.test"
  "$build/core/test/kernel/check_waveform" "$trace" --axis x --driver a4988 --step "$header:17" \
    --dir "$header:27" --enable "$header:22" --shortest-interval $((1000000000 / 160 - 2100000))  # late by up to 2 ms
}

# stepdriver_check on that kernel, with lines that it can have and with lines that it can't.
test_check_in_kernel() {
  bash "$src/test/kernel/check_test.sh" "$build/catkin/devel/lib/stepdriver/stepdriver_check" \
    "$build/core/test/kernel/check_waveform"
}

# Only the install space is on any path here.
check_install() {
  local share=$build/install/share/stepdriver launch_file program
  rm -rf "$build/install"
  quietly install install_catkin
  use_ros "$build/install"
  [[ $(rospack find stepdriver) == "$share" ]] || die "rospack doesn't find $share"
  for launch_file in "$share"/launch/*.launch "$share"/launch/examples/*.launch; do
    say "${launch_file##*/}:"
    roslaunch --files stepdriver "${launch_file##*/}" | indent
  done
  "$build/install/lib/stepdriver/stepdriver_node" --help >"$build/log/node-help.log" ||
    die "stepdriver_node --help doesn't work"
  rosrun stepdriver stepdriver_joystick --help >"$build/log/joystick-help.log" ||
    die "stepdriver_joystick --help doesn't work"
  rosrun stepdriver stepdriver_base --help >"$build/log/base-help.log" ||
    die "stepdriver_base --help doesn't work"
  for program in console draw measure_resonance panel plot_motion tune_stall; do
    rosrun stepdriver "$program" --help >"$build/log/$program-help.log" ||
      die "$program --help doesn't work"
  done
  rosrun stepdriver stepdriver_check --config "$share/config/a4988.yaml" --backend simulated \
    >"$build/log/check-installed.log" || die "stepdriver_check doesn't work"
  if grep -rIl -e "$build/catkin" "$build/install"; then
    die "these installed files refer to the build folder"
  fi
}

# Every installed command, and the service, as far as possible without a running systemd.
check_operations() {
  use_ros "$build/install"
  bash "$src/test/operations/operations_test.sh" "$build/install"
}

# Who can reach the node: the loopback, ssh and the firewall of docs/security.md.
check_fences() {
  use_ros "$build/install"
  bash "$src/test/operations/fences_test.sh" "$build/install"
}

# A catkin package that depends on the installed package.
check_dependent() {
  use_ros "$build/install"
  bash "$src/test/library/catkin_test.sh" "$build/install"
}

# The commands of the pages, with the installed package.
check_docs() {
  use_ros "$build/install"
  /usr/bin/python3 -B "$root/test/docs/commands_test.py"
}

check_trace() { bash "$root/scripts/demo.sh" --installed; }

# ---- sanitizers: builds by the presets fuzz, which has those of the preset asan, and tsan

# configure_sanitized PRESET: with the tests of the core in the same build, which compiles it once.
configure_sanitized() { cmake -S "$src" --preset "$1" -B "$build/catkin-$1" -DSTEPDRIVER_TESTS=ON; }
build_sanitized() { cmake --build "$build/catkin-$1" -j "$jobs" --target "${@:2}"; }

# Exports the environment of the test preset of that name.
use_test_preset() {
  local exports
  # shellcheck disable=SC2016  # sourceDir is CMake's.
  exports=$(/usr/bin/python3 -B -c '
import json, shlex, sys
source, name = sys.argv[1:]
with open(source + "/CMakePresets.json", encoding="utf-8") as file:
    presets = json.load(file)["testPresets"]
for key, value in next(p for p in presets if p["name"] == name)["environment"].items():
    print("export", shlex.quote(key + "=" + value.replace("${sourceDir}", source)))' "$src" "$1")
  eval "$exports"
}

# The search is of whole machines. The targets of --fuzz have these sanitizers too, and share the build.
build_core_asan() {
  configure_sanitized fuzz && build_sanitized fuzz pulse_tests recorder_tests search_tests threads_tests
}
# Those with more than one thread: the others have nothing to find for ThreadSanitizer.
build_core_tsan() {
  configure_sanitized tsan && build_sanitized tsan gpio_tests port_tests pulse_tests recorder_tests threads_tests
}
# After that of the core.
build_node_tsan() { build_sanitized tsan stepdriver_node; }

# sanitize_core SANITIZER PRESET: runs the tests of the programs that are built by that preset.
sanitize_core() {
  await "build_core_$1"
  use_test_preset "$1"
  # The number of schedules of each kind that the search samples.
  STEPDRIVER_SCHEDULES=400 ctest --test-dir "$build/catkin-$2/stepdriver_core" -j "$jobs" --timeout 300 \
    --no-tests=error --output-on-failure -E "_NOT_BUILT\$|^library\$|^CheckWaveform\$|^RigSoak|$slow_tests"
}
# These take long with a sanitizer.
slow_tests='ForEachPairOfRequests|HybridWait.SpinsForLess|KeepTheAngleWhatever'
sanitize_core_asan() { sanitize_core asan fuzz; }
sanitize_core_tsan() { sanitize_core tsan tsan; }

# Runs a storm and a test of --ros. Only the node that they start has the
# sanitizer. It writes its findings to files, because not every test reads all that its node prints.
sanitize_node_tsan() {
  local findings=$build/log/tsan-findings name status=0
  await build_node_tsan
  quietly tsan-tests-build build_node_tests storm_test node_tests
  rm -f "$findings".*
  use_test_preset tsan
  export "TSAN_OPTIONS=${TSAN_OPTIONS:-}:log_path=$findings"
  use_ros "$build/catkin/devel"
  export STEPDRIVER_NODE=$build/catkin-tsan/devel/lib/stepdriver/stepdriver_node
  # The sanitizer's own memory grows.
  rostest "$src/test/node/storm/storm.test" most_growth:=300 || status=1
  rostest "$src/test/node/node.test" test:=ending_test || status=1
  for name in "$findings".*; do
    [[ -f $name ]] || continue
    say "$name:"
    head -n 50 "$name"
    status=1
  done
  return "$status"
}
build_node_tests() {
  configure_catkin "$strict" && cmake --build "$build/catkin" -j "$jobs" --target "$@"
}

# Floods against a node. The figures are printed, and judged by hand: a test fails by what is wrong, never
# because something took long.
test_bad_days() {
  quietly bad-days-build build_node_tests stepdriver_node bad_days_test
  use_ros "$build/catkin/devel"
  # Besides each flood there are its moves and its check.
  rostest --text "$src/test/bad_days/bad_days.test" "seconds:=$flood_seconds" \
    "limit:=$((flood_seconds * 20 + 300))" | tee "$build/log/bad-days.log"
  # With --text the exit code of rostest is meaningless.
  grep -qF '[  PASSED  ]' "$build/log/bad-days.log" || return 1
  ! grep -qF '[  FAILED  ]' "$build/log/bad-days.log"
}

# The same inputs each time and on each computer: new ones are tried by hand, so that a change fails only for
# what it did.
check_fuzz() { await build_fuzz && bash "$root/scripts/fuzz.sh" --repeatable; }
# All of it stays in the group that an interrupt ends.
build_fuzz() { in_group=1 bash "$root/scripts/fuzz.sh" --build; }

# The room that depends most on the processor. The tests of the motions take minutes there: the comparison
# of step times stands for them. scripts/cross.sh tests all rooms.
rooms_for_arm64=(pulse)
build_arm64() { in_group=1 bash "$root/scripts/cross.sh" --build arm64 "${rooms_for_arm64[@]}"; }
# cross ARGUMENT...: if this computer can't have the compiler, the libraries or the emulator, it is skipped.
cross() {
  local status=0
  bash "$root/scripts/cross.sh" "$@" 2>"$build/log/cross.log" || status=$?
  ((status != skip_status)) || skip "$(tail -n 1 "$build/log/cross.log")"
  cat "$build/log/cross.log" >&2
  return "$status"
}
check_arm64() {
  # It has built, or the next command says why it can't.
  await build_arm64 >"$build/log/await-arm64.log" || true
  cross arm64 "${rooms_for_arm64[@]}"
}
check_board() { cross --board arm64; }

choose_build_folder
rm -rf "$build/ros"
rm -f "$build"/log/*.times
install_packages core ccache "${wanted[@]}" "$(wants node && echo ros plots panel ros-tests browser)" \
  "$(wants ros && echo trace)" "$(wants core && echo python python-tests pictures ${thorough:+bench})" \
  "$(wants lint && echo python ros plots ros-tests bench)" \
  "$(wants sanitize && echo ros ros-tests fuzz)" "$(wants bad-days && echo ros ros-tests)" \
  "$(wants fuzz && echo ros)"
# If they can't be installed, its stages say so.
! wants arm64 || (install_packages cross-arm64 board-arm64) || true
# Compilers newer than Debian 12's may have more warnings. All builds have the same option, because ccache
# shares only results of the same options.
strict=-DCMAKE_COMPILE_WARNING_AS_ERROR=OFF
[[ $(c++ -dumpversion) != 12* ]] || strict=-DCMAKE_COMPILE_WARNING_AS_ERROR=ON
# The core's files have the same path in each build, seen from there, so that ccache compiles them once.
export CCACHE_BASEDIR=$build

later=()  # what runs in the background
if wants lint; then
  stage lint
  part shell check_shell
  part doxygen check_doxygen
  part packages check_packages
  part command-table check_command_table
  part links check_links
  part reliability check_reliability
  part spelling check_spelling
  part format check_format
  ! has_clang_14 || later+=(tidy_all)
fi
if wants core; then
  stage core
  part build build_core
  part tests test_core 'core build'
  part pictures check_pictures 'core build'
fi
! wants sanitize || later+=(build_core_asan build_core_tsan build_node_tsan)
! wants fuzz || later+=(build_fuzz)
! wants arm64 || later+=(build_arm64)
begin_background "${later[@]}"
if wants node; then
  stage node
  part build build_node
  part tests test_node 'node build'
fi
if wants ros; then
  stage package
  part install check_install 'node build'
  part dependent check_dependent 'package install'
  part operations check_operations 'package install'
  part fences check_fences 'package install'
  part trace check_trace 'package install'
  part pages check_docs 'package install'
fi
if wants kernel; then
  stage kernel
  part build build_for_kernel 'core build'
  part lines test_kernel 'kernel build'
  part gpiod2 test_kernel_gpiod2 'kernel lines'
  ! wants node || part node test_node_in_kernel 'kernel lines' 'node build'
  ! wants node || part check test_check_in_kernel 'kernel lines' 'node build'
fi
if wants lint; then
  stage tidy
  part tidy check_tidy
fi
if wants sanitize; then
  stage sanitizers
  part asan-core sanitize_core_asan
  part tsan-core sanitize_core_tsan
  part tsan-node sanitize_node_tsan
fi
if wants bad-days; then
  stage bad-days
  part floods test_bad_days
fi
if wants fuzz; then
  stage fuzz
  part inputs check_fuzz
fi
if wants arm64; then
  stage arm64
  part rooms check_arm64
  part board check_board 'arm64 rooms'
fi
end_stage

for function in "${later[@]}"; do
  [[ ! -f $build/log/background-$function.times ]] || summary+=$(printf '  %-27s %7d s' "$function" \
    "$(processor_seconds "background-$function")")$'\n'
done
for log in "${failed_parts[@]}"; do show_failure "$log"; done
say "" "stage        result     time  processor time" "$summary" \
  "In all $SECONDS s, and $(processor_seconds '*') s of processor time."
say "$stages_passed passed, $stages_failed failed, $stages_skipped skipped"
((stages_failed == 0))
