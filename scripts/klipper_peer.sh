#!/usr/bin/env bash
# Runs the tests of boards against a program of Klipper's firmware.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/klipper_peer.sh --program PROGRAM

Builds the tests of boards, starts PROGRAM, and runs the tests KlipperPeer against it in real time: motions,
stops, a switch, a shutdown of the firmware and its recovery, and a line that spoils bytes. PROGRAM is the
firmware that Klipper's own manual builds for a Linux process (its MCU "Linux process"). A library stands in
for its GPIO lines and hides the pauses of this computer, so it needs no rights; as root it gets a real-time
priority. Exit code 0: every step was played once, and the counts were right.
END
}

program=
while (($# > 0)); do
  case $1 in
    -h | --help) usage && exit ;;
    --program)
      [[ -n ${2:-} ]] || { usage >&2 && exit 2; }
      program=$2
      shift 2
      ;;
    *) usage >&2 && exit 2 ;;
  esac
done
[[ -n $program ]] || { usage >&2 && exit 2; }
[[ -x $program ]] || die "there is no program $program"
program=$(readlink -f "$program")

choose_build_folder
install_packages core
build_peer() {
  configure_core -DSTEPDRIVER_TESTS=ON &&
    cmake --build "$build/core" -j "$jobs" --target klipper_tests peer_lines
}
say "Building"
quietly klipper-peer-build build_peer

folder=$(mktemp -d)
pid=
end_peer() {
  [[ -z $pid ]] || kill "$pid" 2>/dev/null
  rm -rf "$folder"
}
at_exit end_peer
export STEPDRIVER_PEER_LINES=$folder/lines STEPDRIVER_KLIPPER_PORT=$folder/port
truncate --size 4096 "$STEPDRIVER_PEER_LINES"
real_time=()
((EUID != 0)) || real_time=(-r)
LD_PRELOAD=$build/core/test/core/libpeer_lines.so "$program" "${real_time[@]}" -I "$STEPDRIVER_KLIPPER_PORT" \
  >"$build/log/klipper.log" 2>&1 &
pid=$!
for ((i = 0; i < 100; ++i)); do
  [[ ! -e $STEPDRIVER_KLIPPER_PORT ]] || break
  sleep 0.1
done
say "Running the tests against $program"
"$build/core/test/core/klipper_tests" --gtest_filter='KlipperPeer.*'
