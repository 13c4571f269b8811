#!/usr/bin/env bash
# Makes a fresh system, and runs demo.sh and test.sh in it.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
# shellcheck source=scripts/roots.sh
source "$root/scripts/roots.sh"

usage() {
  cat <<'END'
usage: scripts/test_in_root.sh bookworm|trixie|focal [--blank] [--keep]
                              [--demo | --python | --packages | --arch arm64|armhf]

Makes a clean root of that Debian, or of Ubuntu 20.04, with debootstrap (minbase, nothing else),
copies the checkout into it, and runs scripts/demo.sh, scripts/test.sh and the demo again there as root,
without a terminal. On Ubuntu it first makes an underlay that stands for ROS Noetic, in /opt/ros/noetic:
diagnostic_updater, rospy and roslaunch, from the sources of Ubuntu 22.04's packages. Then it only runs
scripts/test.sh --core --node, without the benchmarks: its Google Benchmark is too old. Prints the exit
codes, and exits with 0 if all of them are 0. Needs root.

The base root is kept in ~/.cache/stepdriver/roots (or in the folder that STEPDRIVER_ROOTS names) for
the next time; the working copy is removed at the end.

  --blank  uses a folder whose path contains a blank: catkin can't build there, so the build goes
           elsewhere. Not with --packages
  --demo   only runs scripts/demo.sh, once: a newcomer's first command
  --python  only runs scripts/python.sh, once: the same without ROS
  --packages  only runs scripts/package.sh --twice, and then tries the Debian packages that it made in
           another clean root, by scripts/package.sh --try
  --arch arm64|armhf  only runs scripts/cross.sh for that processor: builds the core with a cross compiler,
           and runs all of its tests under an emulator
  --keep   keeps the working copy, and prints its path
END
}

suite='' keep='' only='' packages='' checkout=/home/user/stepdriver
while (($# > 0)); do
  case $1 in
    bookworm | trixie | focal) suite=$1 ;;
    --blank) checkout="/home/new user/step driver" ;;
    --demo) only=demo.sh ;;
    --python) only=python.sh ;;
    --packages) only='package.sh --twice' packages=1 ;;
    --arch)
      [[ ${2:-} == arm64 || ${2:-} == armhf ]] || { usage >&2 && exit 2; }
      only="cross.sh $2"
      shift
      ;;
    --keep) keep=1 ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
  esac
  shift
done
[[ -n $suite ]] || { usage >&2 && exit 2; }
[[ -z $packages || $checkout != *' '* ]] || { usage >&2 && exit 2; }
[[ -z $only || $suite != focal ]] || die "on Ubuntu only scripts/test.sh --core --node can be tried"
(($(id -u) == 0)) || die "needs root, for debootstrap and chroot: sudo $0 $suite"

# ---- the base ----

commands=(demo.sh test.sh demo.sh)
underlay=
[[ -z $only ]] || commands=("$only")
if [[ $suite == focal ]]; then
  commands=('test.sh --core --node')
  underlay=/opt/ros/noetic
fi
make_base_root "$suite"

# ---- the copy ----

copies=()
remove_copies() {
  local copy
  for copy in "${copies[@]}"; do
    if [[ -n $keep ]]; then
      say "Kept: $copy"
    else
      rm -rf --one-file-system "$copy"
    fi
  done
}
at_exit remove_copies

# make_copy: a clean root with the checkout, in $work.
make_copy() {
  work=$(mktemp -d "$roots/$suite.XXXXXX")
  copies+=("$work")
  say "Copying the checkout into a clean $suite in $work"
  cp -a "$base/." "$work/"
  connect_root "$work"
  # As an installer of Debian writes it.
  printf '127.0.0.1 localhost\n127.0.1.1 %s\n' "$(hostname)" >"$work/etc/hosts"

  mkdir -p "$work$checkout"
  if git -C "$root" rev-parse --is-inside-work-tree >/dev/null 2>&1; then
    (cd "$root" && git ls-files -z --cached --others --exclude-standard) |
      while IFS= read -r -d '' name; do
        [[ ! -e $root/$name ]] || printf '%s\0' "$name"
      done | tar -C "$root" --null -T - -c
  else
    tar -C "$root" --exclude=./build --exclude=./.git -c .
  fi | tar -C "$work$checkout" --no-same-owner -x
}
make_copy

# ---- the run ----

# The run has its own mount and process namespaces, if that is allowed: whatever it mounts or starts
# ends with it.
enter=(chroot)
if unshare --mount --pid --fork --kill-child true 2>/dev/null; then
  # shellcheck disable=SC2016
  enter=(unshare --mount --pid --fork --kill-child bash -c '
    # The root of a system is a mount point, and some programs depend on it.
    mount --bind "$1" "$1" && mount -t proc proc "$1/proc" && mount -t tmpfs tmpfs "$1/dev/shm" &&
      mount -t devpts -o ptmxmode=0666 devpts "$1/dev/pts" || true
    exec chroot "$@"' in_root)
else
  say "Namespaces aren't allowed here: continuing without /proc, /dev/shm and /dev/pts"
fi

in_root() {
  "${enter[@]}" "$work" /usr/bin/env -i HOME=/root LANG=C.UTF-8 \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    ${http_proxy+http_proxy="$http_proxy"} ${https_proxy+https_proxy="$https_proxy"} \
    ${no_proxy+no_proxy="$no_proxy"} ${underlay:+STEPDRIVER_UNDERLAY="$underlay"} "$@"
}

# diagnostic_updater, which Ubuntu 20.04 lacks, and what its Python packages of ROS do worse than Noetic's:
# rospy spoils the second call of a persistent connection, and roslaunch is older. The sources are those of
# Ubuntu 22.04's packages, whose version is one of Noetic's; the changes for Debian aren't needed.
make_underlay() {
  mkdir -p "$work/tmp/underlay/lists/partial"
  printf 'deb-src %s jammy universe\n' "$mirror" >"$work/tmp/underlay/sources.list"
  # shellcheck disable=SC2016
  in_root bash -euxc '
    cd /tmp/underlay
    own=(-o Dir::Etc::sourcelist="$PWD/sources.list" -o Dir::Etc::sourceparts=-
      -o Dir::State::lists="$PWD/lists" -o APT::Sandbox::User=root)
    export DEBIAN_FRONTEND=noninteractive
    apt-get -q update
    apt-get -q -y --no-install-recommends install build-essential catkin cmake libdiagnostic-msgs-dev \
      librosbag-storage-dev libroscpp-dev libstd-msgs-dev python3-roslaunch python3-rospy \
      ros-message-generation ros-std-msgs xz-utils
    apt-get "${own[@]}" -q update
    apt-get "${own[@]}" -q --download-only --tar-only source ros-diagnostics ros-ros-comm
    for file in ros-*.orig.tar.xz; do tar -xf "$file"; done
    for package in diagnostics-*/diagnostic_updater ros_comm-*/tools/{rosgraph,rosmaster,rosparam,roslaunch} \
      ros_comm-*/clients/rospy; do
      cmake -S "$package" -B "build/$package" -DCMAKE_BUILD_TYPE=Release -DCATKIN_ENABLE_TESTING=OFF \
        -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCMAKE_INSTALL_PREFIX="$1"
      cmake --build "build/$package" --target install
    done' make_underlay "$underlay"
  rm -rf "$work/tmp/underlay"
}
if [[ -n $underlay ]]; then
  say "Building packages of ROS into $underlay of that root"
  run make_underlay >"$roots/$suite-underlay.log" 2>&1
  ((run_status == 0)) || die "that failed; its output: $roots/$suite-underlay.log"
fi

exit_codes=''
worst=0
# try_command SCRIPT [OPTION...]
try_command() {
  local start=$SECONDS
  say "" "######## $suite: scripts/$*"
  run in_root bash "$checkout/scripts/$1" "${@:2}"
  exit_codes+=" $* exit code $run_status after $((SECONDS - start)) s;"
  ((run_status == 0)) || worst=1
}
for command in "${commands[@]}"; do
  read -ra words <<<"$command"
  try_command "${words[@]}"
done
# What the build needs would hide what a package forgets to depend on.
if [[ -n $packages ]] && ((worst == 0)); then
  made=$work$checkout/build/packages
  make_copy
  cp -a "$made" "$work/made-packages"
  try_command package.sh --try /made-packages
fi

say "" "On a clean $suite:${exit_codes%;}"
((worst == 0))
