#!/usr/bin/env bash
# Draws the pictures of docs/motion.md from the edges of motions on the simulated rig.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/motion_pictures.sh [--check]

Builds the core's trace_tests, runs their tests of pictures, and draws docs/pictures from its traces.
Installs missing packages.

  --check  draws the pictures into another folder, and checks that docs/motion.md shows each of them and
           no other. With the matplotlib of Debian 12, which drew docs/pictures, they must be identical
END
}

check=
case ${1:-} in
  '') ;;
  --check) check=1 ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

choose_build_folder
install_packages core pictures
pictures=$root/docs/pictures
[[ -z $check ]] || pictures=$build/pictures
traces=$build/motion-traces
rm -rf "$traces" "$build/pictures"
mkdir -p "$traces" "$pictures"

quietly pictures-configure configure_core
quietly pictures-build cmake --build "$build/core" -j "$jobs" --target trace_tests
STEPDRIVER_TRACES=$traces quietly pictures-traces "$build/core/test/core/trace_tests" \
  --gtest_filter='*Pictures.*'
/usr/bin/python3 "$root/scripts/motion_pictures.py" "$traces" "$pictures"
[[ -n $check ]] || exit 0

drawn=$(cd "$pictures" && ls)
shown=$(grep -o 'pictures/[a-z_]*[.]svg' "$root/docs/motion.md" | sed 's|.*/||' | sort -u)
[[ $drawn == "$shown" ]] || die "docs/motion.md shows" \
  "${shown//$'\n'/ }, but this drew ${drawn//$'\n'/ }"
if [[ $(/usr/bin/python3 -c 'import matplotlib; print(matplotlib.__version__)') == 3.6.* ]]; then
  diff -rq "$root/docs/pictures" "$pictures" ||
    die "docs/pictures doesn't show the current motions; run scripts/motion_pictures.sh"
  say "All pictures show the current motions."
else
  say "All pictures can be drawn."
fi
