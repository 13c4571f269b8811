#!/usr/bin/env bash
# Measures the speed of the core and the node, and compares each figure with its target.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/bench.sh [--quick]

Installs missing packages, builds the benchmarks (bench/) for speed, runs them, and prints the table
of bench/figures.txt: each measurement, its target, and whether the target was met. The figures of each
program, and the table, go to build/bench/*.json. Paced runs follow: they measure how late the engine's
edges come on this computer against the steady clock, idle and busy, compared with a plain
clock_nanosleep() and, if linuxcnc-uspace is installed, its base thread; the results go to
build/bench/paced.json. Exit code 0: every target was met, no pulse was shorter and no step closer than
allowed.

  --quick  fewer repetitions, only to see that everything runs
END
}

repetitions=15 seconds=0.05 paced=(--seconds 1) latency=()
case ${1:-} in
  '') ;;
  --quick) repetitions=1 seconds=0.01 paced=(--quick --seconds 0.1) latency=(--calls 20 --seconds 1 --points 3000) ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

choose_build_folder
install_packages core bench
bench=$build/bench
mkdir -p "$bench"
rm -f "$bench"/*.json

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
for program in "$bench"/core/bench/*_bench; do
  say "Running ${program##*/}"
  quietly "${program##*/}" run_bench "$program"
done

say "Running stop_latency"
quietly stop_latency "$bench/core/bench/stop_latency" "${latency[@]}" --json "$bench/stop_latency_bench.json"

# Only if ROS is installed: the core's figures don't need it.
if [[ -x /usr/bin/roscore || -x /usr/bin/catkin_make ]]; then
  say "Running node_bench"
  bash "$root/scripts/node_bench.sh"
fi

say "" "Medians of $repetitions repetitions, on $(nproc) cores, load $(cut -d' ' -f1 /proc/loadavg)" ""
status=0
/usr/bin/python3 "$root/scripts/bench_table.py" "$root/bench/figures.txt" "$bench/table.json" \
  "$bench"/*_bench.json || status=$?

say "" "Paced runs, lateness in us" ""
"$bench/core/bench/paced" "${paced[@]}" --json "$bench/paced.json" || status=$?
"$root/bench/linuxcnc_base_thread.sh" || say "LinuxCNC's base thread couldn't be measured"
((status == 0))
