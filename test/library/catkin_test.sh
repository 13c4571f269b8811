#!/usr/bin/env bash
# Tests that a catkin package that depends on stepdriver compiles with every header of the core, and links.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/library/catkin_test.sh PREFIX

Builds test/library/catkin_user in an empty folder against the install space PREFIX, and runs its program.
Call it in the environment of PREFIX. Exit status 0: all passed.
END_OF_USAGE
}
case ${1:-} in
  -h | --help) usage && exit ;;
esac
(($# == 1)) || { usage >&2 && exit 2; }
prefix=$(realpath "$1")
here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd -P)

die() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

package=$scratch/catkin_user
cp -r "$here/catkin_user" "$package"
cp "$here/core_user/core_user.cpp" "$package"
(cd "$prefix/include" && find stepdriver_core -name '*.h' | sort | sed 's|.*|#include "&"|') \
  >"$package/every_header.cpp"
[[ -s $package/every_header.cpp ]] || die "there is no header of the core in $prefix/include"
cmake -S "$package" -B "$scratch/build" -DPYTHON_EXECUTABLE=/usr/bin/python3 \
  >"$scratch/configure.log" 2>&1 || die "$(<"$scratch/configure.log")"
cmake --build "$scratch/build" >"$scratch/build.log" 2>&1 || die "$(<"$scratch/build.log")"
said=$("$scratch/build/devel/lib/catkin_user/catkin_user" 2>&1) || die "catkin_user ended with $?: $said"
[[ $said == *libgpiod* ]] || die "catkin_user said: $said"
printf 'A catkin package that depends on stepdriver compiles, links and runs: %s\n' "$said"
