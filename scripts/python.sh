#!/usr/bin/env bash
# Builds the Python package stepdriver_core, without ROS, and moves an axis with it.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/python.sh [PROGRAM [ARGUMENT...]]

Installs the Debian packages that are missing, builds the Python package stepdriver_core in the folder python
of the build folder, and runs a Python program with it: by default examples/python/move_axis.py, which moves
an axis of the simulated rig. Prints what PYTHONPATH must be for other programs. It needs no ROS.
END
}
case ${1:-} in
  -h | --help) usage && exit ;;
esac
(($# > 0)) || set -- "$root/examples/python/move_axis.py"

choose_build_folder
install_packages core python
say "Building the package (tail -f $build/log/python-build.log)"
build_python() {
  # Optimized like the other builds, but without what a debugger needs; and several files at once.
  cmake -S "$src/stepdriver_core" -B "$build/python" -DCMAKE_BUILD_TYPE=Release \
    "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG$roomy" -DCMAKE_UNITY_BUILD_BATCH_SIZE=12 \
    -DSTEPDRIVER_TESTS=OFF -DSTEPDRIVER_PYTHON=ON &&
    cmake --build "$build/python" -j "$jobs" --target stepdriver_python
}
quietly python-build build_python
export PYTHONPATH=$build/python/python
say "For other programs: export PYTHONPATH=$PYTHONPATH"
exec /usr/bin/python3 "$@"
