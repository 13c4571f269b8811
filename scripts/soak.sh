#!/usr/bin/env bash
# Lets whole machines run for long, and watches positions, chips' times, memory and descriptors.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/soak.sh [--minutes MINUTES] [--edges EDGES] [--kernel] [--seed SEED]

Installs missing packages, builds the core, and sends random commands of every kind (moves, lines,
trajectories, jogs, stops, holds, disables, emergency stops, settings) to a machine with three axes for
MINUTES (default: 60) on the simulated rig, which runs as fast as it can; with --kernel at the same time
to three axes on GPIO lines of the test kernel. With --edges it sends them instead from one thread in
virtual time, until that many edges of STEP have gone out: the same SEED (default: 1) gives the same edges.

A position must be the count of the pulses that the rig, or the kernel, has seen; no time of a chip may be
violated; memory and descriptors must be flat. Prints a line each minute, and a summary. Exit code 0:
nothing was found.
END
}

minutes=60 edges='' seed=1 kernel=
while (($# > 0)); do
  case $1 in
    -h | --help) usage && exit ;;
    --kernel) kernel=1 && shift ;;
    --minutes | --edges | --seed)
      [[ ${2:-} =~ ^[0-9]+(e[0-9]+)?$ ]] || { usage >&2 && exit 2; }
      printf -v "${1#--}" %s "$2"
      shift 2
      ;;
    *) usage >&2 && exit 2 ;;
  esac
done

choose_build_folder
install_packages core ${kernel:+kernel}
targets=(rig_soak)
[[ -z $kernel ]] || targets+=(kernel_soak)
build_soak() {
  configure_core -DSTEPDRIVER_TESTS=ON &&
    cmake --build "$build/core" -j "$jobs" --target "${targets[@]}"
}
say "Building"
quietly soak-build build_soak
programs=$build/core/test/bad_days/soak

if [[ -n $edges ]]; then
  "$programs/rig_soak" --clients 0 --edges "$edges" --seed "$seed"
  exit
fi
kernel_status=0 rig_status=0 on_kernel=
if [[ -n $kernel ]]; then
  set -m
  STEPDRIVER_GPIO_SIM=1 bash "$src/test/kernel/run.sh" --timeout $((minutes * 60 + 300)) -- \
    "$programs/kernel_soak" --minutes "$minutes" --seed "$seed" </dev/null &
  set +m
  on_kernel=$!
fi
end_kernel() { [[ -z $on_kernel ]] || end_group "$on_kernel" 5; }
at_exit end_kernel
"$programs/rig_soak" --minutes "$minutes" --seed "$seed" || rig_status=$?
if [[ -n $on_kernel ]]; then
  wait "$on_kernel" || kernel_status=$?
  on_kernel=
fi
((rig_status == 0 && kernel_status == 0))
