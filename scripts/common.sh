# shellcheck shell=bash
# Shared by demo.sh, test.sh and test_in_root.sh: paths, Debian packages, builds, ROS and cleanup.
# Sourced, never run; needs `set -euo pipefail`.

# Prefer Debian's own tools and Python, whatever else is on PATH; print numbers with a decimal point.
export PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH"
export LC_ALL=C.UTF-8 PYTHONNOUSERSITE=1 PYTHONDONTWRITEBYTECODE=1
unset PYTHONPATH PYTHONHOME PYTHONSTARTUP VIRTUAL_ENV PYENV_VERSION
unset LD_LIBRARY_PATH PKG_CONFIG_PATH CMAKE_PREFIX_PATH CMAKE_GENERATOR DESTDIR CDPATH "${!ROS_@}"
# STEPDRIVER_UNDERLAY names a folder with ROS packages that the system's own lack, such as /opt/ros/noetic.
if [[ -n ${STEPDRIVER_UNDERLAY:-} ]]; then
  [[ -f $STEPDRIVER_UNDERLAY/setup.bash ]] || {
    printf '%s\n' "STEPDRIVER_UNDERLAY=$STEPDRIVER_UNDERLAY: there is no setup.bash in it" >&2
    exit 1
  }
  set +u
  # shellcheck disable=SC1091
  source "$STEPDRIVER_UNDERLAY/setup.bash"
  set -u
fi
# Nothing here reads messages in Lisp or JavaScript.
export ROS_LANG_DISABLE=geneus:genlisp:gennodejs

# The checkout, with every symbolic link on the way resolved.
root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd -P)
jobs=$(nproc)

say() { printf '%s\n' "$@"; }
indent() { sed 's/^/    /'; }
die() {
  printf '%s: %s\n' "${0##*/}" "$*" >&2
  exit 1
}

# ---- the end ----

cleanups=()
# Adds a function that runs when the script ends, however it ends; the last added runs first.
at_exit() { cleanups=("$1" "${cleanups[@]}"); }
run_cleanups() {
  local status=$? cleanup
  trap '' INT TERM HUP
  trap - EXIT
  set +e
  for cleanup in "${cleanups[@]}"; do "$cleanup"; done
  exit "$status"
}
trap run_cleanups EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

# Ends a background job that was started under `set -m`: asks its leader (a roslaunch then ends
# its nodes in order), and kills the rest of its process group after SECONDS.
end_group() {
  local leader=$1 seconds=$2 i
  kill -TERM "$leader" 2>/dev/null || true
  for ((i = 0; i < seconds * 10; i++)); do
    kill -0 -- "-$leader" 2>/dev/null || break
    sleep 0.1
  done
  kill -KILL -- "-$leader" 2>/dev/null || true
  wait "$leader" 2>/dev/null || true
}

# Runs a command, or a function under `set -e`, and waits for it. It has a process group of its
# own, which ends with this script: an interrupt leaves nothing behind. Sets run_status, and always
# returns 0: in a condition, the function would continue after a failing command.
run() {
  run_status=0
  if [[ -n ${in_group:-} ]]; then
    (set -e; "$@") </dev/null || run_status=$?
    return 0
  fi
  set -m
  (set -e; in_group=1; "$@") </dev/null &
  set +m
  group=$!
  wait "$group" || run_status=$?
  group=
}
group=
end_run() {
  [[ -n $group ]] || return 0
  kill -TERM -- "-$group" 2>/dev/null
  end_group "$group" 30
}
at_exit end_run

# ---- where things are ----

safe_path() { [[ $1 =~ ^[A-Za-z0-9_./+-]+$ ]]; }

# Creates the build folder and sets
#   build   the folder for all build products: a path that works with catkin
#   src     the checkout as CMake and ROS see it: a path that works with catkin
# catkin's tests fail if a path contains a space. In that case, and if the checkout isn't writable, the
# build goes to a cache folder, which refers to the checkout through a symbolic link.
# STEPDRIVER_BUILD names another folder.
choose_build_folder() {
  local key place
  src=$root
  if [[ -n ${STEPDRIVER_BUILD:-} ]]; then
    mkdir -p "$STEPDRIVER_BUILD" || die "can't make the build folder $STEPDRIVER_BUILD"
    build=$(cd "$STEPDRIVER_BUILD" && pwd -P)
    safe_path "$build" || die "STEPDRIVER_BUILD=$build: catkin can't build there; use a path that" \
      "has only letters, digits and _ . / + -"
  elif safe_path "$root" && mkdir -p "$root/build" 2>/dev/null && [[ -w $root/build ]]; then
    build=$root/build
  else
    key=$(printf '%s' "$root" | sha256sum | cut -c1-12)
    place=${XDG_CACHE_HOME:-${HOME:-/nonexistent}/.cache}/stepdriver
    if ! safe_path "$place" || ! mkdir -p "$place" 2>/dev/null || [[ ! -w $place ]]; then
      place=/var/tmp/stepdriver-$(id -u)
      mkdir -m 700 "$place" 2>/dev/null || true
      [[ -d $place && -O $place ]] || die "$place belongs to someone else; set STEPDRIVER_BUILD"
    fi
    build=$place/$key
    mkdir -p "$build"
  fi
  if ! safe_path "$root"; then
    src=$build/src
    ln -sfnT "$root" "$src"
  fi
  mkdir -p "$build/log"
  # ROS writes nothing to the home folder, and uses no network but the loopback.
  export ROS_HOME=$build/ros ROS_IP=127.0.0.1
}

# Runs a command with its output in a file; shows the end of the output only if the command fails.
# If the command is a function, it must join its own commands with &&.
quietly() {
  local log=$build/log/$1.log
  shift
  run "$@" >"$log" 2>&1
  ((run_status == 0)) && return
  tail -n 200 "$log" >&2
  say "failed with exit code $run_status: $*" "its full output: $log" >&2
  return "$run_status"
}

# ---- Debian packages ----

# The packages of the named groups of packages.txt.
list_packages() {
  awk -v groups=" $* " '
    { sub(/#.*/, "") }
    $1 ~ /^\[/ { gsub(/[][]/, "", $1); wanted = index(groups, " " $1 " "); next }
    NF && wanted { print $1 }' "$root/scripts/packages.txt"
}

# Removes from `missing` the optional packages that apt doesn't know. Without package lists apt knows none,
# so all of them stay.
leave_out_unknown() {
  local package kept=() unknown=()
  compgen -G '/var/lib/apt/lists/*_Packages*' >/dev/null || return 0
  for package in "${missing[@]}"; do
    if grep -qE "^$package +# optional" "$root/scripts/packages.txt" &&
      ! apt-cache show "$package" >/dev/null 2>&1; then
      unknown+=("$package")
    else
      kept+=("$package")
    fi
  done
  ((${#unknown[@]} == 0)) || say "Without what this system doesn't have: ${unknown[*]}"
  missing=("${kept[@]}")
}

# Installs the missing packages of the named groups. Asks apt, and for root, only if some are missing.
install_packages() {
  local wanted present missing as_root=()
  mapfile -t wanted <<<"$(list_packages "$@")"
  [[ -x /usr/bin/dpkg-query && -x /usr/bin/apt-get ]] ||
    die "this isn't Debian: install the packages of scripts/packages.txt yourself"
  present=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null |
    sed -n 's/^installed //p') || true
  mapfile -t missing <<<"$(printf '%s\n' "${wanted[@]}" | grep -vxF -e "$present")"
  [[ -n ${missing[0]} ]] || return 0
  leave_out_unknown
  ((${#missing[@]} > 0)) || return 0

  if (($(id -u) != 0)); then
    command -v sudo >/dev/null ||
      die "as root, run: apt-get install --no-install-recommends ${missing[*]}"
    as_root=(sudo -n)
    # Asks for the password now, because apt-get runs in the background, away from the terminal.
    if [[ -t 0 || -t 2 ]]; then sudo -v || die "needs root to install packages"; fi
  fi
  say "Installing ${#missing[@]} Debian packages and their dependencies:"
  fold -s -w 92 <<<"${missing[*]}" | indent
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
    apt-get -q -y -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3)
  quietly apt-update "${apt[@]}" update ||
    say "apt-get update failed; trying with the package lists as they are"
  leave_out_unknown
  ((${#missing[@]} > 0)) || return 0
  quietly apt-install "${apt[@]}" install --no-install-recommends "${missing[@]}" ||
    die "apt-get couldn't install the packages (its output is above)"
}

# ---- builds ----

# discard_foreign_build SOURCES FOLDER: discards a build that was made for sources at another path.
discard_foreign_build() {
  local from=$1 into=$2
  [[ -f $into/CMakeCache.txt ]] || return 0
  grep -qxF -e "CMAKE_HOME_DIRECTORY:INTERNAL=$from" "$into/CMakeCache.txt" || rm -rf "$into"
}

# If each compiler has 2 GB, it begins to collect its garbage later: that takes 7 % of its time.
# Both sizes are in kB.
roomy=$(awk -v jobs="$jobs" '$1 == "MemTotal:" && $2 / jobs >= 2e6 { print " --param=ggc-min-heapsize=524288" }' \
  /proc/meminfo 2>/dev/null) || true
# With -g1 a backtrace names each line, and the compiler is a third faster than with all that a debugger
# could show.
build_type=(-DCMAKE_BUILD_TYPE=RelWithDebInfo "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O2 -g1 -DNDEBUG$roomy"
  -DCMAKE_UNITY_BUILD_BATCH_SIZE=24)  # one file of so many takes 15 % less time than three of eight

configure() {
  local from=$1 into=$2
  shift 2
  discard_foreign_build "$from" "$into"
  cmake -S "$from" -B "$into" "${build_type[@]}" \
    -DCMAKE_EXPORT_COMPILE_COMMANDS=ON "$@"
}

configure_core() { configure "$src/stepdriver_core" "$build/core" "$@"; }
configure_catkin() {
  discard_foreign_build "$src" "$build/catkin"
  # catkin writes the environment of the tests when it configures, and leaves out the path of the
  # messages' Python modules if that folder doesn't exist yet.
  mkdir -p "$build/catkin/devel/lib/python3/dist-packages"
  configure "$src" "$build/catkin" -DPYTHON_EXECUTABLE=/usr/bin/python3 \
    -DCMAKE_INSTALL_PREFIX="$build/install" "$@"
}
build_catkin() {
  configure_catkin "$@" &&
    cmake --build "$build/catkin" -j "$jobs"
}
# The install space is for use, and the devel space only for tests: it lies below the sources, so in it
# roslaunch finds each launch file twice, and rosrun finds no program.
install_catkin() { cmake --install "$build/catkin"; }

# ---- ROS ----

# Sets the environment of a devel or install space, and a free port for a master of our own.
use_ros() {
  local setup=$1/setup.bash
  [[ -f $setup ]] || die "$setup isn't there: the build of the ROS package failed"
  set +u
  # shellcheck disable=SC1090
  source "$setup"
  set -u
  choose_master
}
# Other roscores on this machine aren't affected.
choose_master() {
  getent hosts localhost >/dev/null || die "ROS needs the line '127.0.0.1 localhost' in /etc/hosts"
  ros_port=$(/usr/bin/python3 -c '
import socket
s = socket.socket()
s.bind(("127.0.0.1", 0))
print(s.getsockname()[1])')
  export ROS_MASTER_URI=http://127.0.0.1:$ros_port
}
