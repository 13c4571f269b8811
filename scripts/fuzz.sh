#!/usr/bin/env bash
# Gives random inputs to everything that reads files, messages and commands.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/fuzz.sh [--build] [--seconds SECONDS] [--seed SEED] [TARGET...]

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

Exit code 0: nothing was found.
END
}

# A target has a folder of inputs. Those without a C++ source are in test/fuzz/readers_fuzz.py.
targets() { (cd "$root/test/fuzz/corpus" && printf '%s\n' *); }

seconds=60 seed=$((RANDOM * 32768 + RANDOM)) only_build='' wanted=()
while (($# > 0)); do
  case $1 in
    -h | --help) usage && exit ;;
    --build) only_build=1 ;;
    --seconds | --seed)
      [[ ${2:-} =~ ^[0-9]+$ ]] || { usage >&2 && exit 2; }
      printf -v "${1#--}" %s "$2"
      shift
      ;;
    *)
      targets | grep -qxF -e "$1" || { usage >&2 && exit 2; }
      wanted+=("$1")
      ;;
  esac
  shift
done
((${#wanted[@]} > 0)) || mapfile -t wanted <<<"$(targets)"

choose_build_folder
install_packages core ros ccache fuzz

build_targets() {
  discard_foreign_build "$src" "$build/catkin-fuzz"
  cmake -S "$src" --preset fuzz -B "$build/catkin-fuzz" &&
    cmake --build "$build/catkin-fuzz" -j "$jobs" --target fuzz_targets
}

fuzz_cpp() {
  local name=$1 options=()
  [[ ! -f $src/test/fuzz/$name.dict ]] || options+=("-dict=$src/test/fuzz/$name.dict")
  # Memory that was freed is kept for a while, to find its use; the limit is for the rest.
  ASAN_OPTIONS=quarantine_size_mb=16:detect_stack_use_after_return=1 UBSAN_OPTIONS=print_stacktrace=1 \
    LSAN_OPTIONS="suppressions=$src/test/sanitizers/leaks.supp:print_suppressions=0" \
    "$build/catkin-fuzz/test/fuzz/${name}_fuzz" "${options[@]}" "-max_total_time=$seconds" "-seed=$seed" \
    -timeout=120 -rss_limit_mb=1024 -print_final_stats=1 "-artifact_prefix=$build/fuzz/found/$name-" \
    "$build/fuzz/$name" "$src/test/fuzz/corpus/$name"
}
fuzz_python() {
  /usr/bin/python3 -B "$src/test/fuzz/readers_fuzz.py" "$1" --seconds "$seconds" --seed "$seed" \
    --kept "$build/fuzz/$1" --found "$build/fuzz/found/$1-" "$build/fuzz/$1" "$src/test/fuzz/corpus/$1"
}

# run_target NAME: writes a line for the summary.
run_target() {
  local name=$1 log=$build/log/fuzz-$1.log status=0 language=python verdict="nothing found"
  mkdir -p "$build/fuzz/$name" "$build/fuzz/found"
  [[ ! -f $src/test/fuzz/${name}_fuzz.cpp ]] || language=cpp
  "fuzz_$language" "$name" >"$log" 2>&1 || status=$?
  ((status == 0)) || verdict="FAILED, see $log"
  printf '%-18s %8s inputs, %6s places in the code reached: %s\n' "$name" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")" \
    "$(sed -n 's/.* cov: \([0-9]*\).*/\1/p' "$log" | tail -n 1)" "$verdict"
  return "$status"
}

show_failure() {
  local log=$build/log/fuzz-$1.log
  say "" "==== $1"
  grep -m 1 -A 40 -E '^broken promise|^==[0-9]+==|runtime error|^ALARM' "$log" || tail -n 40 "$log"
  grep 'Test unit written' "$log" || true
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
say "Seed $seed, $seconds seconds for each target"
run run_targets
((run_status == 0))
