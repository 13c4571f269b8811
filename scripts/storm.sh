#!/usr/bin/env bash
# Sends all kinds of requests to a running node from several clients at once, and judges the results.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/storm.sh [--minutes MINUTES] [--seed SEED]

Installs missing packages, builds the package, and lets four clients send random requests of every kind
(moves, lines, trajectories, jogs, homings, stops, holds, disables, emergency stops, settings) to a node
with three axes on the simulated rig, for MINUTES (default: 5), from SEED (default: a new one each time,
which is printed; even ones have another machine than odd ones). Then the oracle (test/node/storm/oracle.h) compares the rig's pin trace with the
answers. It prints each broken promise with the requests around it. Exit code 0: every promise was kept.
END
}

minutes=5 seed=$((RANDOM * 32768 + RANDOM))
while (($# > 0)); do
  case $1 in
    -h | --help) usage && exit ;;
    --minutes | --seed)
      [[ ${2:-} =~ ^[0-9]+$ ]] || { usage >&2 && exit 2; }
      printf -v "${1#--}" %s "$2"
      shift 2
      ;;
    *) usage >&2 && exit 2 ;;
  esac
done

choose_build_folder
install_packages core ros ros-tests
build_storm() {
  configure_catkin && cmake --build "$build/catkin" -j "$jobs" --target stepdriver_node storm_test
}
say "Building"
quietly storm-build build_storm
use_ros "$build/catkin/devel"
say "Seed $seed, for $minutes minutes"
# The judgement follows the storm: reading the trace of an hour takes a while. A node that STEPDRIVER_NODE
# names has a sanitizer, whose own memory grows.
rostest --text "$src/test/node/storm/storm.test" "seconds:=$((minutes * 60))" "seed:=$seed" \
  "limit:=$((minutes * 90 + 300))" ${STEPDRIVER_NODE:+most_growth:=300} | tee "$build/log/storm.log"
# With --text the exit code of rostest is meaningless.
grep -qF '[  PASSED  ] 1 test.' "$build/log/storm.log"
