#!/usr/bin/env bash
# Builds the core for another processor, and runs its tests under an emulator.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/cross.sh [--build] arm64|armhf [ROOM...]
       scripts/cross.sh --board arm64
       scripts/cross.sh --node arm64|armhf [TEST...]

Builds the core and the tests of the named rooms (folders of test/core; all of them by default) with
Debian's cross compiler, and runs them under qemu-user, but for the search of all pairs of requests; of named
rooms, without the tests that take minutes there. Then makes a set of motions with that build and with this
computer's own, and compares the times of their steps, to the nanosecond.

The compiler and the emulator are installed if they are missing. The libraries come from this computer's
apt sources, and are unpacked into a folder outside the system: its own architectures remain as they are.
That folder is kept in ~/.cache/stepdriver/cross (or $XDG_CACHE_HOME/stepdriver/cross). Exit status 77,
with the reason, if something of this isn't available.

  --build  only builds
  --board  boots Debian's kernel on a whole machine under QEMU instead, and moves the axis of
           examples/move_axis with the GPIO lines of that machine, by libgpiod. QEMU's own record of the
           lines must have each pulse of the move and no other, and the motor enabled for it
  --node   makes the packages for that processor (scripts/package.sh --arch) instead, and runs their node
           under qemu-user against this computer's build of the named rostests; by default against all but
           those that depend on time, reach into the node's process or start launch files
END
}

only=
case ${1:-} in
  --build | --board | --node)
    only=${1#--}
    shift
    ;;
esac
case ${1:-} in
  arm64) triplet=aarch64-linux-gnu processor=aarch64 emulator=qemu-aarch64-static ;;
  armhf) triplet=arm-linux-gnueabihf processor=arm emulator=qemu-arm-static ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac
arch=$1
case $only-$arch-$# in
  board-armhf-* | board-arm64-[!1]*) usage >&2 && exit 2 ;;
esac
rooms=("${@:2}")

missing() {
  printf 'cross.sh: %s can not be tried here: %s\n' "$arch" "$*" >&2
  exit 77
}

choose_build_folder
wanted=(core "cross-$arch")
case $only in
  board) wanted+=(board-arm64) ;;
  node) wanted+=(ros plots ros-tests) ;;
esac
# In a process of its own, because it ends the shell if it fails.
(install_packages "${wanted[@]}") >&2 || missing "its packages can't be installed"
cross=$build/cross-$arch

# ---- the libraries of the other processor ----

# shellcheck source=scripts/sysroots.sh
source "$root/scripts/sysroots.sh"

# ---- the node ----

# Those that depend on time, look into the node's process, load a library into it, or start this computer's node
# by a launch file.
tests_of_this_computer=(line_action_test wall_clock_test descriptors_test exhausted_test failing_disk_test examples_test launch_test)
test_emulated_node() {
  local tests=("$@") name status=0
  quietly "node-$arch-packages" bash "$root/scripts/package.sh" --arch "$arch"
  unpacked=$cache/$release-$arch-packages
  rm -rf "$cross/node"
  mkdir -p "$cross/node"
  dpkg-deb -x "$build/packages-$arch"/ros-stepdriver_*.deb "$cross/node"
  cat >"$cross/stepdriver_node" <<END
#!/bin/sh
exec /usr/bin/$emulator -L $unpacked $cross/node/usr/lib/stepdriver/stepdriver_node "\$@"
END
  chmod +x "$cross/stepdriver_node"
  quietly "node-$arch-tests" configure_catkin
  if ((${#tests[@]} == 0)); then
    for name in "$src"/test/node/*_test.cpp; do
      name=$(basename "$name" .cpp)
      [[ " ${tests_of_this_computer[*]} " == *" $name "* ]] || tests+=("$name")
    done
  fi
  quietly "node-$arch-tests" cmake --build "$build/catkin" -j "$jobs" --target node_tests
  use_ros "$build/catkin/devel"
  for name in "${tests[@]}"; do
    STEPDRIVER_NODE=$cross/stepdriver_node rostest "$src/test/node/node.test" "test:=$name" || status=1
  done
  return "$status"
}
if [[ $only == node ]]; then
  test_emulated_node "${rooms[@]}"
  exit
fi

# ---- the core ----

# The kernel without its modules, and a shell.
unpack_board() {
  local work=$1/work package
  use_own_lists "$work"
  package=$(apt-cache "${own_lists[@]}" depends "linux-image-$arch" | sed -n 's/^ *Depends: \(linux-image\)/\1/p') &&
    (cd "$work" && apt-get "${own_lists[@]}" -q download "$package" busybox-static) &&
    for package in "$work"/*.deb; do
      dpkg-deb --fsys-tarfile "$package" | tar -C "$1" --wildcards -x './boot/vmlinuz*' ./bin/busybox 2>/dev/null || true
    done
  [[ -x $1/bin/busybox && -n $(find "$1/boot" -name 'vmlinuz*') ]] && rm -rf "$work"
}
keep "$arch" unpack_packages libc6-dev libfmt-dev libgpiod-dev libgtest-dev libstdc++6 libyaml-cpp-dev nlohmann-json3-dev zlib1g-dev
sysroot=$unpacked

# ---- its builds ----

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
((${#targets[@]} > 0)) && targets+=(check_waveform trace_tests) || targets=(all)
[[ $only != board ]] || targets=(stepdriver_core_yaml)

configure_cross() {
  configure "$src/stepdriver_core" "$cross/core" "-DCMAKE_TOOLCHAIN_FILE=$cross/toolchain.cmake" "$strict"
}
build_cross() { cmake --build "$cross/core" -j "$jobs" --target "${targets[@]}"; }

say "Building the core for $arch"
quietly "cross-$arch-configure" configure_cross
quietly "cross-$arch-build" build_cross

# ---- a whole machine

# The machine "virt" of QEMU has a PL061 with 8 lines, of which nobody uses these.
step=0 dir=1 enable=2
example=$root/examples/move_axis
steps=4000  # 50 mm of 80 steps/mm

# Its files are a shell, the example and the libraries that it loads.
make_board() {
  local board=$1 files=$1/files library
  rm -rf "$board"
  mkdir -p "$files"/{bin,dev,proc,sys,example}
  "$triplet-g++" --sysroot="$sysroot" -std=c++17 -O2 "$example/move_axis.cpp" -o "$files/example/move_axis" \
    -I "$root/stepdriver_core/include" "$cross"/core/libstepdriver_core{_yaml,}.a \
    -lyaml-cpp -lfmt -lgpiod -lz -pthread &&
    sed -e 's/backend: simulated/backend: libgpiod/' -e "s/GPIO17/9030000.pl061:$step/" \
      -e "s/GPIO27/9030000.pl061:$dir/" -e "s/GPIO22/9030000.pl061:$enable/" \
      "$example/axis.yaml" >"$files/example/axis.yaml" || return
  "/usr/bin/$emulator" -L "$sysroot" -E LD_TRACE_LOADED_OBJECTS=1 "$files/example/move_axis" |
    sed -n 's|.*[ \t]\(/[^ ]*\) (0x.*|\1|p' | while IFS= read -r library; do
    mkdir -p "$files${library%/*}" && cp -L "$sysroot$library" "$files$library" || return
  done || return
  cp "$kernel/bin/busybox" "$files/bin/" || return
  cat >"$files/init" <<'END' || return
#!/bin/busybox sh
/bin/busybox mount -t devtmpfs dev /dev
/bin/busybox mount -t proc proc /proc
/bin/busybox mount -t sysfs sys /sys
/bin/busybox uname -srm
cd /example && ./move_axis
/bin/busybox poweroff -f
END
  chmod +x "$files/init"
  (cd "$files" && find . | cpio --quiet -o -H newc --owner=0:0 | gzip -1) >"$board/initrd.gz"
}
# Its time is the number of instructions that it carried out, at 8 ns each: a busy computer makes nothing late.
boot_board() {
  timeout 300 qemu-system-aarch64 -machine virt -cpu cortex-a72 -icount shift=3,sleep=off -m 512 -nic none -display none -no-reboot \
    -serial stdio -kernel "$kernel"/boot/vmlinuz-* -initrd "$cross/board/initrd.gz" \
    -append 'console=ttyAMA0 quiet panic=-1' -trace pl061_set_output -D "$cross/board/lines.log"
}
# QEMU records what its PL061 drives: "pl061_set_output ... setting output 0 to 1".
count_pulses() {
  awk -v step="$step" -v dir="$dir" -v enable="$enable" '
    { level[$(NF - 2)] = $NF }
    $(NF - 2) == step && $NF == 1 { pulses++; if (level[enable] != 0) print "a pulse with the motor disabled" }
    $(NF - 2) == dir && level[step] == 1 { print "DIR changed during a pulse" }
    END { print pulses + 0 " pulses" }' "$cross/board/lines.log"
}
if [[ $only == board ]]; then
  keep "$arch-board" unpack_board
  kernel=$unpacked
  quietly "board-$arch-files" make_board "$cross/board"
  boot_board | tee "$build/log/board-$arch.log"
  grep -qF 'x is at 0.0500 m' "$build/log/board-$arch.log" || die "the move failed there"
  counted=$(count_pulses)
  [[ $counted == "$steps pulses" ]] || die "QEMU's record of the lines, which must have $steps pulses, has: $counted"
  say "QEMU's record of its lines has all of the $steps pulses, and the motor was enabled."
  exit
fi

# This computer's own build of the motions.
[[ -f $build/core/CMakeCache.txt ]] || quietly cross-own-configure configure_core
quietly cross-own-build cmake --build "$build/core" -j "$jobs" --target trace_tests
[[ $only != build ]] || exit 0

# ---- its tests ----

# Not the search of all pairs of requests, which takes hours there, nor the test that measures its own memory, which
# is the emulator's. Of named rooms: not the programs that aren't built, and not what takes minutes there.
left_out='ForEachPairOfRequests|^RigSoak$'
((${#rooms[@]} == 0)) || left_out='_NOT_BUILT$|^RigSoak|^PlannerProperties|Random(Moves|Cubics)|HybridWait.SpinsForLess|'\
'AccelerationLimitedTiming.*RandomPaths'
# The search of several requests: fewer schedules run almost the same code.
(cd "$cross/core" && STEPDRIVER_SCHEDULES=1000 ctest -j "$jobs" --timeout 1800 --no-tests=error --output-on-failure -E "$left_out")

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
