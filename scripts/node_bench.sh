#!/usr/bin/env bash
# Measures the node at rest and its services, with a master of its own; bench.sh calls it.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/node_bench.sh [AXES...]

For each number of axes (default: 6 32) starts a node with that many axes on the simulated rig. Writes its
start time, the processor time and memory that it uses at rest, and the duration of move_to compared with
an empty service to build/bench/node_AXES_bench.json. Then writes how long stop and emergency_stop take
while a node with three axes prepares trajectories of 300,000 points for two clients to
build/bench/node_preparing_bench.json. STEPDRIVER_CATKIN names a build of the package to use; without it,
the script builds the package.
END
}

case ${1:-} in -h | --help) usage && exit ;; esac
(($# > 0)) || set -- 6 32

choose_build_folder
install_packages core ros
mkdir -p "$build/bench"
catkin=${STEPDRIVER_CATKIN:-$build/bench/catkin}
build_node() {
  configure "$src" "$catkin" -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCMAKE_BUILD_TYPE=Release \
    -DCATKIN_DEVEL_PREFIX="$catkin/devel" -DCATKIN_ENABLE_TESTING=OFF -DSTEPDRIVER_BENCH=ON &&
    cmake --build "$catkin" -j "$jobs" --target stepdriver_node node_bench listener
}
[[ -n ${STEPDRIVER_CATKIN:-} ]] || quietly node-bench-build build_node
use_ros "$catkin/devel"
# Axes of 8000 steps/s, as in config/a4988.yaml.
configuration() {
  local i
  say "gpio: {backend: simulated}" "axes:"
  for ((i = 0; i < $1; i++)); do
    say "  a$i:" "    driver: a4988" "    joint: a${i}_joint" \
      "    pins: {step: S$i, dir: D$i, enable: E$i}" "    microsteps: 16" \
      "    steps_per_mm: 80.0" "    max_speed_mm_s: 100.0" "    acceleration_mm_s2: 500.0" \
      "    min_position_mm: -200.0" "    max_position_mm: 200.0" "    enable_on_start: true"
  done
}

set -m
roscore -p "$ros_port" >"$build/log/node-bench-roscore.log" 2>&1 </dev/null &
roscore=$!
set +m
end_roscore() { end_group "$roscore" 10; }
at_exit end_roscore
for ((i = 0; i < 300; i++)); do
  ! rosparam list >/dev/null 2>&1 || break
  sleep 0.1
done

bench=$catkin/devel/lib/stepdriver/node_bench node=$catkin/devel/lib/stepdriver/stepdriver_node
set_parameters() {
  configuration "$1" >"$build/bench/node_$1.yaml"
  rosparam delete /stepdriver >/dev/null 2>&1 || true
  rosparam load "$build/bench/node_$1.yaml" /stepdriver
}
for axes; do
  set_parameters "$axes"
  quietly "node-bench-$axes" "$bench" "$node" "$axes" "$build/bench/node_${axes}_bench.json"
done
set_parameters 3
quietly node-bench-preparing "$bench" --preparing "$node" "$build/bench/node_preparing_bench.json"
