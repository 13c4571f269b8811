#!/usr/bin/env bash
# Makes a fresh system, and runs demo.sh and test.sh in it.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/test_in_root.sh bookworm|trixie|focal [--blank] [--keep]
                              [--demo | --packages | --arch arm64|armhf]

Makes a clean root of that Debian, or of Ubuntu 20.04, with debootstrap (minbase, nothing else),
copies the checkout into it, and runs scripts/demo.sh, scripts/test.sh and the demo again there as root,
without a terminal. On Ubuntu, whose own packages have no diagnostic_updater, it only runs
scripts/test.sh --core, without the benchmarks: its Google Benchmark is too old. Prints their exit
codes, and exits with 0 if all of them are 0. Needs root.

The base root is kept in ~/.cache/stepdriver/roots (or in the folder that STEPDRIVER_ROOTS names) for
the next time; the working copy is removed at the end.

  --blank  uses a folder whose path contains a blank: catkin can't build there, so the build goes
           elsewhere
  --demo   only runs scripts/demo.sh, once: a newcomer's first command
  --packages  only runs scripts/package.sh --twice --try: makes the Debian packages and tries them
  --arch arm64|armhf  only runs scripts/cross.sh for that processor: builds the core with a cross compiler,
           and runs all of its tests under an emulator
  --keep   keeps the working copy, and prints its path
END
}

suite='' keep='' only='' checkout=/home/user/stepdriver
while (($# > 0)); do
  case $1 in
    bookworm | trixie | focal) suite=$1 ;;
    --blank) checkout="/home/new user/step driver" ;;
    --demo) only=demo.sh ;;
    --packages) only='package.sh --twice --try' ;;
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
[[ -z $only || $suite != focal ]] || die "on Ubuntu only scripts/test.sh --core can be tried"
(($(id -u) == 0)) || die "needs root, for debootstrap and chroot: sudo $0 $suite"
command -v debootstrap >/dev/null || die "needs debootstrap: apt-get install debootstrap"

# ---- the base ----

# The mirror from which this machine's apt gets the suites, or the default address.
mirror_of() {
  local label=$1 default=$2 found
  # shellcheck disable=SC2016
  found=$(apt-get indextargets --format '$(LABEL) $(REPO_URI)' 2>/dev/null |
    sed -n "s/^$label //p" | head -n 1) || true
  printf '%s' "${found:-$default}"
}

# How this machine's apt reaches the mirrors: proxies, certificates, checks.
apt_transport() {
  apt-config dump | grep -E '^Acquire::(http|https|Check-|Retries|ForceIPv)' || true
}

roots=${STEPDRIVER_ROOTS:-${XDG_CACHE_HOME:-${HOME:-/root}/.cache}/stepdriver/roots}
mkdir -p "$roots"
roots=$(cd "$roots" && pwd -P)
base=$roots/$suite
commands=(demo.sh test.sh demo.sh)
[[ -z $only ]] || commands=("$only")
if [[ $suite == focal ]]; then
  components=main,universe
  mirror=$(mirror_of Ubuntu http://archive.ubuntu.com/ubuntu)
  security_suite="$mirror $suite-security"
  commands=('test.sh --core')
else
  components=main
  mirror=$(mirror_of Debian http://deb.debian.org/debian)
  security_suite="$(mirror_of Debian-Security http://deb.debian.org/debian-security) $suite-security"
fi

if [[ ! -d $base ]]; then
  say "Making $base from $mirror"
  rm -rf "$base.new"
  include=()
  [[ $mirror != https* ]] || include=(--include=ca-certificates)
  run debootstrap --variant=minbase --components="$components" "${include[@]}" "$suite" "$base.new" "$mirror" >"$base.log" 2>&1
  ((run_status == 0)) || die "debootstrap failed; its output: $base.log"
  mv "$base.new" "$base"
fi

# ---- the copy ----

work=$(mktemp -d "$roots/$suite.XXXXXX")
remove_work() {
  if [[ -n $keep ]]; then
    say "Kept: $work"
  else
    rm -rf --one-file-system "$work"
  fi
}
at_exit remove_work
say "Copying the checkout into a clean $suite in $work"
cp -a "$base/." "$work/"
cp -L /etc/resolv.conf "$work/etc/resolv.conf"
# As an installer of Debian writes it.
printf '127.0.0.1 localhost\n127.0.1.1 %s\n' "$(hostname)" >"$work/etc/hosts"
apt_transport >"$work/etc/apt/apt.conf.d/90host"
cat >"$work/etc/apt/sources.list" <<END
deb $mirror $suite ${components/,/ }
deb $mirror $suite-updates ${components/,/ }
deb $security_suite ${components/,/ }
END

mkdir -p "$work$checkout"
if git -C "$root" rev-parse --is-inside-work-tree >/dev/null 2>&1; then
  (cd "$root" && git ls-files -z --cached --others --exclude-standard) |
    while IFS= read -r -d '' name; do
      [[ ! -e $root/$name ]] || printf '%s\0' "$name"
    done | tar -C "$root" --null -T - -c
else
  tar -C "$root" --exclude=./build --exclude=./.git -c .
fi | tar -C "$work$checkout" --no-same-owner -x

# ---- the run ----

# The run has its own mount and process namespaces, if that is allowed: whatever it mounts or starts
# ends with it.
inside=(chroot "$work")
if unshare --mount --pid --fork --kill-child true 2>/dev/null; then
  # shellcheck disable=SC2016
  inside=(unshare --mount --pid --fork --kill-child bash -c '
    # The root of a system is a mount point, and some programs depend on it.
    mount --bind "$1" "$1" && mount -t proc proc "$1/proc" && mount -t tmpfs tmpfs "$1/dev/shm" &&
      mount -t devpts -o ptmxmode=0666 devpts "$1/dev/pts" || true
    exec chroot "$@"' in_root "$work")
else
  say "Namespaces aren't allowed here: continuing without /proc, /dev/shm and /dev/pts"
fi

in_root() {
  "${inside[@]}" /usr/bin/env -i HOME=/root LANG=C.UTF-8 \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    ${http_proxy+http_proxy="$http_proxy"} ${https_proxy+https_proxy="$https_proxy"} \
    ${no_proxy+no_proxy="$no_proxy"} "$@"
}

exit_codes=''
worst=0
for command in "${commands[@]}"; do
  say "" "######## $suite: scripts/$command"
  start=$SECONDS
  # shellcheck disable=SC2086
  run in_root bash "$checkout/scripts/"$command
  exit_codes+=" $command exit code $run_status after $((SECONDS - start)) s;"
  ((run_status == 0)) || worst=1
done

say "" "On a clean $suite:${exit_codes%;}"
((worst == 0))
