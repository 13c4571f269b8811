#!/usr/bin/env bash
# Builds the test kernel if it isn't built yet, and prints its path.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/kernel/build_kernel.sh [-h | --path]

Builds a User-Mode-Linux kernel with simulated GPIO chips (gpio-sim) from the newest of Debian's
packages linux-source-*, configured by kernel.config, and prints its path. The first build takes some
minutes. The kernel is kept in ~/.cache/stepdriver/kernel (or $XDG_CACHE_HOME/stepdriver/kernel), in a
folder for each version of the source and each configuration, together with the log of its build.

  --path  only prints the path, whether the kernel exists or not

The packages that it needs are in the group [kernel] of scripts/packages.txt.
END_OF_USAGE
}

die() {
  printf 'build_kernel.sh: %s\n' "$@" >&2
  exit 1
}

only_path=
case $# in
  0) ;;
  1)
    case $1 in
      -h | --help) usage && exit ;;
      --path) only_path=1 ;;
      *) usage >&2 && exit 2 ;;
    esac
    ;;
  *) usage >&2 && exit 2 ;;
esac

# Prefer Debian's own compiler and tools, whatever else is on PATH. The caller may have been started by
# make, whose settings must not reach this build.
export PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH" LC_ALL=C.UTF-8
unset MAKEFLAGS MFLAGS MAKELEVEL MAKEOVERRIDES CFLAGS CXXFLAGS CPPFLAGS LDFLAGS
unset ARCH SUBARCH CROSS_COMPILE KBUILD_OUTPUT KCONFIG_CONFIG CDPATH

here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd -P)
[[ $(uname -m) == x86_64 ]] || die "User-Mode Linux needs an x86_64 machine; this is $(uname -m)"

# ---- what to build ----

source_file=$(find /usr/src -maxdepth 1 -name 'linux-source-*.tar.xz' 2>/dev/null | sort -V | tail -n 1)
[[ -n $source_file ]] ||
  die "the kernel's source isn't in /usr/src: as root, run: apt-get install linux-source"
package=$(basename "$source_file" .tar.xz)
# The version of a source that isn't a Debian package is a hash of its content.
version=$(dpkg-query -W -f='${Version}' "$package" 2>/dev/null) ||
  version=${package#linux-source-}+$(sha256sum "$source_file" | cut -c1-12)
key=$(cat "$here/kernel.config" "$here/patch_kernel.sh" | sha256sum | cut -c1-12)
cache=${XDG_CACHE_HOME:-${HOME:?}/.cache}/stepdriver/kernel
place=$cache/$version-$key

if [[ -n $only_path || -x $place/linux ]]; then
  printf '%s\n' "$place/linux"
  exit
fi

missing=()
for tool in bc bison flex gcc make xz; do
  command -v "$tool" >/dev/null || missing+=("$tool")
done
((${#missing[@]} == 0)) ||
  die "missing: ${missing[*]}. Install the group [kernel] of scripts/packages.txt"

# ---- the build ----

mkdir -p "$place"
exec {lock}>"$place/lock"
flock "$lock"
# Another process may have built it meanwhile.
if [[ -x $place/linux ]]; then
  printf '%s\n' "$place/linux"
  exit
fi

# Not in the cache: kbuild refuses paths with blanks.
tree=$(mktemp -d /var/tmp/stepdriver-kernel.XXXXXX)
trap 'rm -rf "$tree"' EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

# The options that differ from kernel.config.
refused_options() { grep -E '^(# )?CONFIG_' "$here/kernel.config" | grep -vxFf .config; }

build() {
  cd "$tree"
  # From these folders, only the files of the configuration are needed, not the sources.
  tar -xf "$source_file" --strip-components=1 \
    --exclude='*/drivers/gpu/*.[ch]' --exclude='*/drivers/media/*.[ch]' \
    --exclude='*/drivers/net/*/*.[ch]' --exclude='*/drivers/staging/*.[ch]' \
    --exclude='*/sound/*.[ch]' --exclude='*/Documentation/*/*'
  bash "$here/patch_kernel.sh"
  make ARCH=um KCONFIG_ALLCONFIG="$here/kernel.config" allnoconfig
  if refused_options; then
    echo "This kernel can't be configured with the options of kernel.config above."
    return 1
  fi
  make ARCH=um -j"$(nproc)" linux
  strip linux
}

printf 'Building the test kernel from %s %s, which takes some minutes; log: %s\n' \
  "$package" "$version" "$tree/build.log" >&2
# The build has its own process group, which ends with this script. As it runs in the background,
# `set -e` applies inside it.
set -m
(set -e; build) >"$tree/build.log" 2>&1 </dev/null {lock}>&- &
builder=$!
set +m
trap 'kill -TERM -- "-$builder" 2>/dev/null || true; rm -rf "$tree"' EXIT
status=0
wait "$builder" || status=$?
# A second time, because a cache may be emptied at any time.
mkdir -p "$place"
cp "$tree/build.log" "$place/build.log"
if ((status != 0)); then
  tail -n 40 "$place/build.log" >&2
  die "the kernel couldn't be built; the full output: $place/build.log"
fi
# A rename is atomic, even for readers that ignore the lock.
cp "$tree/linux" "$place/linux.new"
mv "$place/linux.new" "$place/linux"
printf '%s\n' "$place/linux"
