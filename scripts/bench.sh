#!/usr/bin/env bash
# Measures the speed of the core and the node, and compares each figure with its target.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/bench.sh [--quick | --compare FILE]

Installs missing packages, builds the benchmarks (bench/) for speed, runs them, and prints the table
of bench/figures.txt: each measurement, its target, and whether the target was met. The figures of each
program, and the table, go to build/bench/*.json. Paced runs follow: they measure how late the engine's
edges come on this computer against the steady clock, idle and busy, compared with a plain
clock_nanosleep() and, if linuxcnc-uspace is installed, its base thread; the results go to
build/bench/paced.json. Exit code 0: every target was met, no pulse was shorter and no step closer than
allowed.

  --quick  fewer repetitions, only to see that everything runs
  --compare FILE  only the benchmarks of the core; compares their ratios with those of the run that FILE
           keeps. If one is above it by more than 25 %, they run again: it fails if that ratio is above it in
           three runs in a row. If there is no FILE yet, this run makes it
END
}

repetitions=15 seconds=0.05 paced=(--seconds 1) latency=() compare=''
case ${1:-} in
  '') ;;
  --quick) repetitions=1 seconds=0.01 paced=(--quick --seconds 0.1) latency=(--calls 20 --seconds 1 --points 3000) ;;
  --compare)
    [[ -n ${2:-} ]] || { usage >&2 && exit 2; }
    compare=$(readlink -m "$2")
    ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

choose_build_folder
install_packages core bench
bench=$build/bench
mkdir -p "$bench"
[[ $compare == "$bench"/* ]] || rm -f "$bench"/*.json

build_bench() {
  configure "$src/stepdriver_core" "$bench/core" -DCMAKE_BUILD_TYPE=Release \
    -DSTEPDRIVER_BENCH=ON -DSTEPDRIVER_TESTS=OFF &&
    cmake --build "$bench/core" -j "$jobs"
}
# The repetitions of all benchmarks of a program take turns, so that noise affects all of them.
run_bench() {
  "$1" --benchmark_repetitions="$repetitions" --benchmark_min_time="$seconds" \
    --benchmark_enable_random_interleaving=true --benchmark_out_format=json \
    --benchmark_out="$bench/${1##*/}.json"
}

say "Building (Release)"
quietly bench-build build_bench
run_all() {
  local program
  for program in "$bench"/core/bench/*_bench; do
    say "Running ${program##*/}"
    quietly "${program##*/}" run_bench "$program"
  done
}
# make_table FILE: prints it too.
make_table() {
  /usr/bin/python3 "$root/scripts/bench_table.py" "$root/bench/figures.txt" "$1" "$bench"/*_bench.json
}

if [[ -n $compare ]]; then
  tables=()
  for number in 1 2 3; do
    run_all
    tables+=("$bench/compared-$number.json")
    # Only the comparison counts here.
    make_table "${tables[-1]}" >"$build/log/bench-table.log" || true
    if [[ ! -f $compare ]]; then
      cp "${tables[-1]}" "$compare"
      say "This run is now in $compare"
      exit
    fi
    say ""
    /usr/bin/python3 "$root/scripts/bench_table.py" --compare "$compare" "${tables[@]}" && exit
  done
  die "these ratios have grown in three runs in a row"
fi

run_all
say "Running stop_latency"
quietly stop_latency "$bench/core/bench/stop_latency" "${latency[@]}" --json "$bench/stop_latency_bench.json"

# Only if ROS is installed: the core's figures don't need it.
if [[ -x /usr/bin/roscore || -x /usr/bin/catkin_make ]]; then
  say "Running node_bench"
  bash "$root/scripts/node_bench.sh"
fi

say "" "Medians of $repetitions repetitions, on $(nproc) cores, load $(cut -d' ' -f1 /proc/loadavg)" ""
status=0
make_table "$bench/table.json" || status=$?

say "" "Paced runs, lateness in us" ""
"$bench/core/bench/paced" "${paced[@]}" --json "$bench/paced.json" || status=$?
"$root/bench/linuxcnc_base_thread.sh" || say "LinuxCNC's base thread couldn't be measured"
((status == 0))
