#!/usr/bin/env bash
# Builds the core for another processor, and runs its tests under an emulator.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/cross.sh [--build] arm64|armhf [ROOM...]

Builds the core and the tests of the named rooms (folders of test/core; all of them by default) with
Debian's cross compiler, and runs them under qemu-user. Then makes a set of motions with that build and
with this computer's own, and compares the times of their steps, to the nanosecond.

The compiler and the emulator are installed if they are missing. The libraries come from this computer's
apt sources, and are unpacked into a folder outside the system: its own architectures remain as they are.
That folder is kept in ~/.cache/stepdriver/cross (or $XDG_CACHE_HOME/stepdriver/cross). Exit status 77,
with the reason, if something of this isn't available.

  --build  only builds
END
}

only_build=
if [[ ${1:-} == --build ]]; then
  only_build=1
  shift
fi
case ${1:-} in
  arm64) triplet=aarch64-linux-gnu processor=aarch64 emulator=qemu-aarch64-static ;;
  armhf) triplet=arm-linux-gnueabihf processor=arm emulator=qemu-arm-static ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac
arch=$1
rooms=("${@:2}")

missing() {
  printf 'cross.sh: %s can not be tried here: %s\n' "$arch" "$*" >&2
  exit 77
}

choose_build_folder
# In a process of its own, because it ends the shell if it fails.
(install_packages core "cross-$arch") >&2 || missing "its packages can't be installed"
cross=$build/cross-$arch

# ---- the libraries of the other processor ----

# Unpacks them into the folder $1, with lists of apt of its own.
unpack_libraries() {
  local sysroot=$1 work=$1/work file package
  mkdir -p "$work"/{lists,cache/archives}/partial "$work/debs"
  : >"$work/status"
  local apt=(-o APT::Architecture="$arch" -o APT::Architectures::="$arch" -o Dir::State="$work"
    -o Dir::State::lists="$work/lists" -o Dir::State::status="$work/status" -o Dir::Cache="$work/cache")
  # apt's own user couldn't read the caller's folder.
  (($(id -u) != 0)) || apt+=(-o APT::Sandbox::User=root)
  # Some of the lists may be enough.
  apt-get "${apt[@]}" -q update || true
  apt-get "${apt[@]}" -q -y --no-install-recommends --download-only install \
    libc6-dev libfmt-dev libgpiod-dev libgtest-dev libstdc++6 libyaml-cpp-dev || return
  for package in "$work"/cache/archives/*.deb; do dpkg-deb -x "$package" "$sysroot" || return; done
  # As in an installed system, /lib is /usr/lib, and no link leads out of the folder.
  if [[ ! -L $sysroot/lib ]]; then
    cp -a "$sysroot/lib/." "$sysroot/usr/lib/" && rm -r "${sysroot:?}/lib" &&
      ln -s usr/lib "$sysroot/lib" || return
  fi
  find "$sysroot" -type l -lname '/*' -print0 | while IFS= read -r -d '' file; do
    ln -sfn "$(realpath -ms --relative-to="${file%/*}" "$sysroot$(readlink "$file")")" "$file"
  done
  rm -rf "$work"
}

cache=${XDG_CACHE_HOME:-${HOME:?}/.cache}/stepdriver/cross
mkdir -p "$cache"
cache=$(cd "$cache" && pwd -P)
# shellcheck disable=SC1091
sysroot=$cache/$(. /etc/os-release && printf '%s' "${VERSION_CODENAME:-$ID}")-$arch
if [[ ! -d $sysroot ]]; then
  say "Unpacking the libraries of $arch into $sysroot"
  new=$(mktemp -d "$cache/.new.XXXXXX")
  remove_new() { rm -rf "$new"; }
  at_exit remove_new
  run unpack_libraries "$new" >"$build/log/cross-libraries.log" 2>&1
  ((run_status == 0)) || missing "its libraries can't be downloaded:" \
    "$(grep -m 1 '^[EW]:' "$build/log/cross-libraries.log" || tail -n 1 "$build/log/cross-libraries.log")"
  # If another run was faster, its folder is kept.
  mv -T "$new" "$sysroot" 2>/dev/null || true
fi

# ---- the builds ----

mkdir -p "$cross"
cat >"$cross/toolchain.cmake" <<END
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR $processor)
set(CMAKE_CXX_COMPILER /usr/bin/$triplet-g++)
set(CMAKE_LIBRARY_ARCHITECTURE $triplet)
set(CMAKE_SYSROOT $sysroot)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR /usr/bin/$emulator -L $sysroot)
END
strict=-DCMAKE_COMPILE_WARNING_AS_ERROR=OFF
[[ $("$triplet-g++" -dumpversion) != 12* ]] || strict=-DCMAKE_COMPILE_WARNING_AS_ERROR=ON
targets=()
for room in "${rooms[@]}"; do targets+=("${room}_tests"); done
((${#targets[@]} > 0)) || targets=(all)

# Several files of the library are compiled as one, which takes half the time; gcc then warns of members
# whose type is in an anonymous namespace.
configure_cross() {
  configure "$src/stepdriver_core" "$cross/core" "-DCMAKE_TOOLCHAIN_FILE=$cross/toolchain.cmake" "$strict" \
    -DCMAKE_UNITY_BUILD=ON -DCMAKE_CXX_FLAGS=-Wno-subobject-linkage
}
build_cross() { cmake --build "$cross/core" -j "$jobs" --target "${targets[@]}" check_waveform trace_tests; }

say "Building the core for $arch"
quietly "cross-$arch-configure" configure_cross
quietly "cross-$arch-build" build_cross

# This computer's own build of the motions.
[[ -f $build/core/CMakeCache.txt ]] || quietly cross-own-configure configure_core
quietly cross-own-build cmake --build "$build/core" -j "$jobs" --target trace_tests
[[ -z $only_build ]] || exit 0

# ---- the tests ----

# Without the entries of programs that aren't built.
(cd "$cross/core" && ctest -j "$jobs" --timeout 600 --no-tests=error --output-on-failure -E '_NOT_BUILT$')

# ---- the same motions on both processors ----

# keep_traces FOLDER COMMAND...
keep_traces() {
  local folder=$1
  shift
  rm -rf "$folder"
  mkdir -p "$folder"
  STEPDRIVER_TRACES=$folder "$@" --gtest_filter='DemoTraces.*:MotionPictures.*'
}
quietly cross-own-traces keep_traces "$cross/own-traces" "$build/core/test/core/trace_tests"
quietly "cross-$arch-traces" keep_traces "$cross/traces" "/usr/bin/$emulator" -L "$sysroot" \
  "$cross/core/test/core/trace_tests"
diff -rq "$cross/own-traces" "$cross/traces" ||
  die "$arch makes other step times than $(dpkg --print-architecture): see the two folders"
say "The step times of $(find "$cross/traces" -type f | wc -l) motions are those of" \
  "    $(dpkg --print-architecture), to the nanosecond: $(cat "$cross"/traces/* | grep -c '^step') steps," \
  "    sha256 $(cd "$cross/traces" && sha256sum ./* | sha256sum | cut -c1-16)"
