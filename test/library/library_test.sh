#!/usr/bin/env bash
# Tests the core as other projects use it: installed, and found by CMake and by pkg-config.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/library/library_test.sh BUILD COMPILER

Installs the core from the build folder BUILD into an empty folder. Each installed header must compile by
itself, and so must its examples, of which each has one. A program must link the core by find_package() and by
pkg-config. So must a copy of examples/move_axis, which must also move its axis. Exit status 0: all passed.
END_OF_USAGE
}
case ${1:-} in
  -h | --help) usage && exit ;;
esac
(($# == 2)) || { usage >&2 && exit 2; }
build=$(realpath "$1")
compiler=$2
root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../.." && pwd -P)

die() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
strict=(-std=c++17 -Wall -Wextra -Wpedantic -Wshadow -Werror)

prefix=$scratch/installed
cmake --install "$build" --prefix "$prefix" >"$scratch/install.log"
if grep -rIlF -e "$build" -e "$root" "$prefix"; then
  die "these installed files refer to the build"
fi

headers=0
while IFS= read -r header; do
  printf '#include "%s"\n' "$header" >"$scratch/header.cpp"
  "$compiler" "${strict[@]}" -fsyntax-only -I "$prefix/include" "$scratch/header.cpp" ||
    die "$header doesn't compile with nothing but the installed headers"
  headers=$((headers + 1))
done < <(cd "$prefix/include" && find . -name '*.h' | sed 's|^\./||' | sort)
((headers > 0)) || die "no header is installed"
printf '%d headers compile, each by itself.\n' "$headers"

if [[ -f $prefix/include/stepdriver_core/yaml.h ]]; then  # the examples read files
  examples=$(python3 "$root/test/library/header_examples.py" "$prefix/include" "$scratch/examples.cpp") ||
    die "$examples"
  "$compiler" -std=c++17 -Wall -Wextra -Werror -Wno-unused-variable -fsyntax-only -I "$prefix/include" \
    "$scratch/examples.cpp" || die "an example of a header doesn't compile"
  printf '%d examples of the headers compile.\n' "$examples"
fi

# says WANTED FOLDER PROGRAM [ARGUMENT...]: runs a program in FOLDER and looks for WANTED in its output.
says() {
  local said
  said=$(cd "$2" && "${@:3}" 2>&1) || die "${*:3} ended with $?: $said"
  [[ $said == *"$1"* ]] || die "${*:3} said: $said"
}
core_says='libgpiod'
example_says='x is at 0.0500 m: '

# builds_by_cmake FOLDER
builds_by_cmake() {
  cmake -S "$1" -B "$1/build" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER="$compiler" \
    >"$scratch/configure.log" 2>&1 || die "$(<"$scratch/configure.log")"
  cmake --build "$1/build" >"$scratch/build.log" 2>&1 || die "$(<"$scratch/build.log")"
}
# builds_by_pkg_config SOURCE MODULE [OPTION]: builds $scratch/program.
builds_by_pkg_config() {
  local flags
  read -ra flags < <(pkg-config ${3:+"$3"} --cflags --libs "$2")
  "$compiler" "${strict[@]}" "$1" -o "$scratch/program" "${flags[@]}" ||
    die "pkg-config ${3:-} $2 gives: ${flags[*]}"
}

cp -r "$root/test/library/core_user" "$root/examples/move_axis" "$scratch"
builds_by_cmake "$scratch/core_user"
says "$core_says" "$scratch" core_user/build/core_user
yaml=
if [[ -f $prefix/include/stepdriver_core/yaml.h ]]; then
  yaml=yes
  builds_by_cmake "$scratch/move_axis"
  says "$example_says" "$scratch/move_axis" build/move_axis
fi
printf 'Programs link it by find_package()%s.\n' "${yaml:+, and move an axis}"

# From a folder to which it was moved: no installed file contains its own path.
mv "$prefix" "$scratch/moved"
export PKG_CONFIG_PATH=$scratch/moved/lib/pkgconfig
[[ -d $PKG_CONFIG_PATH ]] || die "there is no $PKG_CONFIG_PATH"
for option in '' --static; do
  builds_by_pkg_config "$scratch/core_user/core_user.cpp" stepdriver_core "$option"
  says "$core_says" "$scratch" ./program
  [[ -n $yaml ]] || continue
  builds_by_pkg_config "$scratch/move_axis/move_axis.cpp" stepdriver_core_yaml "$option"
  says "$example_says" "$scratch/move_axis" ../program
done
printf 'Programs link it by pkg-config%s.\n' "${yaml:+, and move an axis}"
