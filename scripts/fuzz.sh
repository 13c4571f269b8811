#!/usr/bin/env bash
# Gives random inputs to everything that reads files, messages and commands.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/fuzz.sh [--build] [--repeatable | [--seconds SECONDS] [--seed SEED]] [TARGET...]

Installs missing packages, builds the targets of test/fuzz with clang, and runs each of them for SECONDS
(default: 60) from SEED (default: a new one each time, which is printed), as many at a time as there are
processors. TARGET is one of:

END
  targets | indent
  cat <<'END'

Without a TARGET all of them are run. The inputs begin with those of test/fuzz/corpus and with those that
earlier runs have found, which remain in the folder fuzz of the build folder. Prints a line for each
target. If one breaks a promise, it also prints why, and the file of the input. To try such a file again,
give it as the argument of the target's program. With --build it only builds.

With --repeatable, as in scripts/test.sh --fuzz, each computer plays the same inputs: as many for each target as
test/fuzz/repeatable.txt says, from seed 1, without those that earlier runs have found, and regardless of time.
A short run of each target is played twice then, and must be the same both times.

Exit code 0: nothing was found.
END
}

# A target has a folder of inputs. Those without a C++ source are in test/fuzz/readers_fuzz.py.
targets() { (cd "$root/test/fuzz/corpus" && printf '%s\n' *); }

repeatable='' chosen='' seconds=60 seed=$((RANDOM * 32768 + RANDOM)) only_build='' wanted=()
while (($# > 0)); do
  case $1 in
    -h | --help) usage && exit ;;
    --build) only_build=1 ;;
    --repeatable) repeatable=1 ;;
    --seconds | --seed)
      [[ ${2:-} =~ ^[0-9]+$ ]] || { usage >&2 && exit 2; }
      printf -v "${1#--}" %s "$2"
      chosen=1
      shift
      ;;
    *)
      targets | grep -qxF -e "$1" || { usage >&2 && exit 2; }
      wanted+=("$1")
      ;;
  esac
  shift
done
if [[ -n $repeatable ]]; then
  [[ -z $chosen ]] || { usage >&2 && exit 2; }
  seed=1
fi
((${#wanted[@]} > 0)) || mapfile -t wanted <<<"$(targets)"

choose_build_folder
install_packages core ros ccache fuzz

build_targets() {
  discard_foreign_build "$src" "$build/catkin-fuzz"
  cmake -S "$src" --preset fuzz -B "$build/catkin-fuzz" &&
    cmake --build "$build/catkin-fuzz" -j "$jobs" --target fuzz_targets
}

# How many inputs a target plays.
runs_of() {
  sed -n "s/^$1 *//p" "$src/test/fuzz/repeatable.txt" | grep -x '[1-9][0-9]*' ||
    die "test/fuzz/repeatable.txt has no number for $1"
}

# Memory that was freed is kept for a while, to find its use; the limit of 1 GB is for the rest.
sanitizer_options=(ASAN_OPTIONS=quarantine_size_mb=16:detect_stack_use_after_return=1
  UBSAN_OPTIONS=print_stacktrace=1 LSAN_OPTIONS=suppressions=sources/../sanitizers/leaks.supp:print_suppressions=0)
common_options=(-rss_limit_mb=1024 -print_final_stats=1)

# fuzz_cpp NAME RUNS: RUNS counts only if the inputs are repeatable.
fuzz_cpp() {
  local name=$1 runs=$2
  cd "$build/fuzz" || return
  [[ ! -f sources/$name.dict ]] || common_options+=("-dict=sources/$name.dict")
  common_options+=("-seed=$seed" "-artifact_prefix=found/$name-")
  if [[ -n $repeatable ]]; then
    # libFuzzer also looks at the depth of the stack, which depends on its address: on the environment, on the
    # paths and on the kernel's randomization. Nothing may depend on the time either, or on the order of a
    # folder's files. What is found stays in memory. Leaks are looked for at the end only: libFuzzer plays an
    # input again if the allocations of all threads don't match while it runs, also those of its own thread.
    "${at_fixed_addresses[@]}" env -i PATH=/usr/bin:/bin "${sanitizer_options[@]}" "programs/${name}_fuzz" \
      "${common_options[@]}" "-runs=$runs" -max_total_time=0 -reload=0 -timeout=1200 -detect_leaks=0 \
      "-seed_inputs=$(printf '%s\n' "sources/corpus/$name"/* | LC_ALL=C sort | paste -s -d ,)"
  else
    env "${sanitizer_options[@]}" "programs/${name}_fuzz" "${common_options[@]}" "-max_total_time=$seconds" \
      -timeout=120 "$name" "sources/corpus/$name"
  fi
}
fuzz_python() {
  local options=(--seconds "$seconds" --kept "$build/fuzz/$1" "$build/fuzz/$1")
  [[ -z $repeatable ]] || options=(--runs "$2")
  PYTHONHASHSEED=0 /usr/bin/python3 -B "$src/test/fuzz/readers_fuzz.py" "$1" --seed "$seed" \
    --found "$build/fuzz/found/$1-" "${options[@]}" "$src/test/fuzz/corpus/$1"
}

# course_of LOG: which inputs a run has played, and what they have reached: nothing of time and memory. A line
# "pulse" comes only if the run has lasted for two seconds.
course_of() { sed -n '/^#[0-9]*\tpulse/d;/^#[0-9]/{s/ exec\/s: .* rss: [^ ]*//;p}' "$1"; }

# repeats LANGUAGE NAME: whether a short run is the same when it is played again.
repeats() {
  local part=$build/log/fuzz-$2-part most
  most=$(($(runs_of "$2") / 20 + $(find "$src/test/fuzz/corpus/$2" -type f | wc -l)))
  ("fuzz_$1" "$2" "$most" >"$part-1.log" 2>&1) || true
  ("fuzz_$1" "$2" "$most" >"$part-2.log" 2>&1) || true
  grep -q '^#[0-9]' "$part-1.log" && diff <(course_of "$part-1.log") <(course_of "$part-2.log") >"$part.diff"
}

# run_target NAME: writes a line for the summary.
run_target() {
  local name=$1 log=$build/log/fuzz-$1.log status=0 language=python verdict="nothing found" runs=0
  mkdir -p "$build/fuzz/$name"
  rm -f "$build/log/fuzz-$name-part.diff"
  [[ ! -f $src/test/fuzz/${name}_fuzz.cpp ]] || language=cpp
  [[ -z $repeatable ]] || runs=$(runs_of "$name") || return
  ("fuzz_$language" "$name" "$runs" >"$log" 2>&1) || status=$?
  ((status == 0)) || verdict="FAILED, see $log"
  if [[ -n $repeatable ]] && ((status == 0)) && ! repeats "$language" "$name"; then
    status=1
    verdict="FAILED, a second run differs: see $build/log/fuzz-$name-part.diff"
  fi
  printf '%-18s %8s inputs, %6s places in the code reached: %s\n' "$name" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")" \
    "$(sed -n 's/.* cov: \([0-9]*\).*/\1/p' "$log" | tail -n 1)" "$verdict"
  return "$status"
}

show_failure() {
  local log=$build/log/fuzz-$1.log differences=$build/log/fuzz-$1-part.diff
  say "" "==== $1"
  if [[ -s $differences ]]; then head -n 10 "$differences" && return; fi
  grep -m 1 -A 40 -E '^broken promise|^==[0-9]+==|runtime error|^ALARM' "$log" || tail -n 40 "$log"
  grep 'Test unit written' "$log" || true
}

prepare() {
  mkdir -p "$build/fuzz/found"
  ln -sfn "$src/test/fuzz" "$build/fuzz/sources"
  ln -sfn "$build/catkin-fuzz/test/fuzz" "$build/fuzz/programs"
  # Some containers don't allow it.
  at_fixed_addresses=()
  if setarch -R true 2>/dev/null; then at_fixed_addresses=(setarch -R); fi
}

run_targets() {
  local name number running=() status=0
  declare -A failed
  for name in "${wanted[@]}"; do
    while (($(jobs -pr | wc -l) >= jobs)); do sleep 0.2; done
    run_target "$name" &
    running+=("$!")
  done
  for number in "${!running[@]}"; do
    wait "${running[number]}" || failed[${wanted[number]}]=1
  done
  for name in "${!failed[@]}"; do
    show_failure "$name"
    status=1
  done
  return "$status"
}

say "Building"
quietly fuzz-build build_targets
[[ -z $only_build ]] || exit 0
much="$seconds seconds for each target"
[[ -z $repeatable ]] || much="as many inputs as test/fuzz/repeatable.txt says"
say "Seed $seed, $much"
prepare
run run_targets
((run_status == 0))
