#!/usr/bin/env bash
# Makes the Debian packages of this checkout, and tries them.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/package.sh [--twice] [--arch arm64|armhf]
       scripts/package.sh --try FOLDER

Installs what the build needs, makes the Debian packages of this checkout, shows lintian's findings, and
leaves the packages in the folder packages of the build folder:

  ros-stepdriver         the node, its launch files and configurations, and the other programs
  stepdriver-service     the services for systemd, with their user, device rule and limits
  python3-stepdriver     the messages for Python
  libstepdriver-dev      the messages for C++, and what catkin needs
  libstepdriver-core-dev the library without ROS
  python3-stepdriver-core the Python package without ROS

  --twice  builds them twice, in different folders: they must be equal
  --try FOLDER  makes nothing, but installs the packages of that folder, with nothing but what they and
           their tests depend on. Runs debian/tests, installs a newer version, then removes and purges them:
           nothing may be left. It changes this system, so use it in one that you can throw away, and that
           has not built them: scripts/test_in_root.sh bookworm --packages
  --arch arm64|armhf  makes the packages of a Raspberry Pi with 64 or 32 bits by Debian's cross compiler, in
           the folder packages-arm64 or packages-armhf. The other packages are for any processor: make them
           without this option. The libraries for that processor are unpacked as scripts/cross.sh does it,
           and are in their places only for this build, in a mount namespace: nothing of them is installed

Exit code 0: all went well, and lintian had no error and no warning.
END
}

twice='' try='' arch=''
while (($# > 0)); do
  case $1 in
    --twice) twice=1 ;;
    --try)
      [[ -d ${2:-} ]] || { usage >&2 && exit 2; }
      try=$(readlink -f "$2")
      shift
      ;;
    --arch)
      [[ ${2:-} == arm64 || ${2:-} == armhf ]] || { usage >&2 && exit 2; }
      arch=$2
      shift
      ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
  esac
  shift
done
[[ -z $try || -z $arch$twice ]] || { usage >&2 && exit 2; }
[[ -z $try ]] || (($(id -u) == 0)) || die "--try needs root"

choose_build_folder

# ---- trying them ----

apt() { DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=600 "$@"; }

# What a package can leave behind: files, users and groups. Others may use the groups gpio and realtime.
contents() {
  find / -xdev \( -path /proc -o -path /sys -o -path /dev -o -path /tmp -o -path /run -o -path /root \
    -o -path /var/cache -o -path /var/log/apt -o -path /var/lib/apt -o -path /var/lib/dpkg \
    -o -path "$root" -o -path "$build" \) -prune -o ! -name __pycache__ ! -name '*.pyc' -print |
    grep -vxF -e /var/log/dpkg.log -e /var/log/alternatives.log | sort
  cut -d: -f1 /etc/passwd /etc/group | grep -vxE 'gpio|realtime'
}

try_packages() {
  local packages=$1 work=$build/tried file name copy own needs
  mkdir -p "$work/newer"
  mapfile -t own < <(cd "$packages" && printf '%s\n' *.deb | sed 's/_.*//')
  say "Installing what they and their tests depend on"
  apt update >"$build/log/package-needs.log" 2>&1
  mapfile -t needs < <(apt --simulate --no-install-recommends install "$packages"/*.deb |
    sed -n 's/^Inst \([^ ]*\) .*/\1/p' | grep -vxF -f <(printf '%s\n' "${own[@]}"))
  mapfile -t -O "${#needs[@]}" needs < <(sed -n '/^Depends:/,/^[A-Z]/ s/^ \(.*\),$/\1/p' "$root/debian/tests/control" |
    grep -vxF -f <(printf '%s\n' "${own[@]}"))
  apt --no-install-recommends install "${needs[@]}" systemd >>"$build/log/package-needs.log" 2>&1
  contents >"$work/before"

  say "Installing them"
  apt --no-install-recommends install "$packages"/*.deb >"$build/log/package-install.log" 2>&1
  (cd "$root" && bash scripts/demo.sh --packaged | tail -n 4 && bash debian/tests/library | tail -n 1 &&
    bash debian/tests/python)
  for name in gpio realtime; do
    getent group "$name" | grep -qw stepdriver || die "stepdriver isn't in the group $name"
  done
  systemd-analyze verify /lib/systemd/system/stepdriver.service
  ! find /etc/systemd/system -name 'stepdriver*' | grep . || die "a service was enabled"

  say "Installing a newer version"
  for file in "$packages"/*.deb; do
    copy=$work/newer/$(basename "$file" .deb)
    mkdir -p "$copy"
    dpkg-deb --raw-extract "$file" "$copy"
    sed -i -e 's/^Version: .*/&+newer/' -e 's/\(stepdriver[a-z-]* (= [0-9.]*\))/\1+newer)/g' "$copy/DEBIAN/control"
    dpkg-deb --root-owner-group -Znone --build "$copy" "$copy.deb"
  done >"$build/log/package-newer.log"
  mkdir -p /etc/stepdriver /var/lib/stepdriver
  printf '# mine\n' >/etc/stepdriver/axes.yaml
  dpkg --install "$work"/newer/*.deb >>"$build/log/package-newer.log" 2>&1
  [[ -f /etc/stepdriver/axes.yaml ]] || die "the upgrade lost /etc/stepdriver/axes.yaml"
  rm /etc/stepdriver/axes.yaml

  say "Removing and purging them"
  dpkg --remove "${own[@]}" >"$build/log/package-remove.log" 2>&1
  dpkg --purge "${own[@]}" >>"$build/log/package-remove.log" 2>&1
  contents >"$work/after"
  diff "$work/before" "$work/after" || die "the packages left something behind"
  say "Nothing is left of them but the groups gpio and realtime."
}
if [[ -n $try ]]; then
  run try_packages "$try"
  ((run_status == 0)) || die "trying the packages failed: see the files package-*.log in $build/log"
  exit
fi

# ---- making them ----

install_packages core python ros package ${arch:+"cross-$arch"}
packages=$build/packages${arch:+-$arch}
builder=(dpkg-buildpackage --no-sign --build=binary --jobs="$jobs")

# ---- the libraries of the other processor ----

# catkin and ros-message-generation aren't marked as usable for another processor, so apt can't install what
# the build needs for it. Overlays add the libraries to /usr and to dpkg's database. Of two files with one
# name, this system's own is seen.
if [[ -n $arch ]]; then
  missing() { die "$arch: $*"; }
  # shellcheck source=scripts/sysroots.sh
  source "$root/scripts/sysroots.sh"
  namespace=(unshare --mount)
  (($(id -u) == 0)) || namespace+=(--map-root-user)
  "${namespace[@]}" true 2>/dev/null || die "$arch: mount namespaces aren't allowed here"
  mapfile -t libraries < <(list_packages core ros | grep '^lib.*-dev$')
  keep "$arch-packages" unpack_packages "${libraries[@]}"
  triplet=$(dpkg-architecture -a "$arch" -q DEB_HOST_GNU_TYPE 2>/dev/null)
  overlay=$build/overlay-$arch
  mkdir -p "$overlay"/{usr/bin,dpkg}
  cat >"$overlay/usr/bin/$triplet-pkg-config" <<END
#!/bin/sh
PKG_CONFIG_LIBDIR=/usr/lib/$triplet/pkgconfig:/usr/share/pkgconfig exec pkg-config "\$@"
END
  chmod +x "$overlay/usr/bin/$triplet-pkg-config"
  cat /var/lib/dpkg/status "$unpacked/var/lib/dpkg/status" >"$overlay/dpkg/status"
  printf '%s\n' "$(dpkg --print-architecture)" "$arch" >"$overlay/dpkg/arch"
  # shellcheck disable=SC2016
  builder=("${namespace[@]}" bash -c '
    mount -t overlay -o "lowerdir=$1/usr:/usr:$2/usr" overlay /usr &&
      mount -t overlay -o "lowerdir=$1/dpkg:/var/lib/dpkg:$2/var/lib/dpkg" overlay /var/lib/dpkg &&
      exec "${@:3}"' with_libraries "$overlay" "$unpacked" "${builder[@]/--build=binary/--build=any}"
    --host-arch="$arch" --no-check-builddeps)
fi

# ---- the packages ----

# make_packages FOLDER: from a copy, because dpkg-buildpackage writes next to the sources.
make_packages() {
  local copy=$1/stepdriver
  rm -rf "$1"
  mkdir -p "$copy"
  tar -C "$root" --exclude=./build --exclude=./.git -c . | tar -C "$copy" --no-same-owner -x
  (cd "$copy" && "${builder[@]}")
}
# A .deb has no path of the machine that made it, and no time but that of debian/changelog.
sums() { (cd "$1" && sha256sum -- *.deb); }

say "Building the packages (tail -f $build/log/package.log)"
quietly package make_packages "$packages"
if [[ -n $twice ]]; then
  say "Building them again, in another folder"
  quietly package-again make_packages "$build/packages-again/longer"
  diff <(sums "$packages") <(sums "$build/packages-again/longer") ||
    die "two builds aren't equal: $packages, $build/packages-again/longer"
  say "Both builds are equal:"
  rm -rf "$build/packages-again"
fi
rm -rf "$packages/stepdriver"
sums "$packages" | indent
say "lintian:"
lintian --allow-root --display-info --fail-on error,warning "$packages"/*.changes | indent
