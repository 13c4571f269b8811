#!/usr/bin/env bash
# Builds the test kernel, where it isn't built yet, and prints its path.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/kernel/build_kernel.sh [-h | --path]

Builds a User-Mode-Linux kernel with simulated GPIO chips (gpio-sim) from the newest of Debian's
packages linux-source-*, as kernel.config says, and prints its path. It takes some minutes the
first time and nothing after that: the kernel is kept in ~/.cache/stepdriver/kernel (or
$XDG_CACHE_HOME/stepdriver/kernel), in a folder for each version of the source and each
configuration, with the log of its build beside it.

  --path  only prints the path, whether the kernel is there or not

packages.txt names what it needs.
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

# Debian's own compiler and tools first, whatever else is on PATH; make's settings of a caller
# that was itself started by make aren't for this one.
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
# Where it isn't a Debian package, its content says which it is.
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
  die "not here: ${missing[*]}. Install the group [kernel] of scripts/packages.txt"

# ---- the build ----

mkdir -p "$place"
exec {lock}>"$place/lock"
flock "$lock"
# Another one may have built it meanwhile.
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

# The options that didn't come out as asked for.
refused_options() { grep -E '^(# )?CONFIG_' "$here/kernel.config" | grep -vxFf .config; }

build() {
  cd "$tree"
  # What these folders compile isn't wanted, only what they say about the configuration.
  tar -xf "$source_file" --strip-components=1 \
    --exclude='*/drivers/gpu/*.[ch]' --exclude='*/drivers/media/*.[ch]' \
    --exclude='*/drivers/net/*/*.[ch]' --exclude='*/drivers/staging/*.[ch]' \
    --exclude='*/sound/*.[ch]' --exclude='*/Documentation/*/*'
  bash "$here/patch_kernel.sh"
  make ARCH=um KCONFIG_ALLCONFIG="$here/kernel.config" allnoconfig
  if refused_options; then
    echo "This kernel can't have the options above as kernel.config asks for them."
    return 1
  fi
  make ARCH=um -j"$(nproc)" linux
  strip linux
}

printf 'Building the test kernel from %s %s in some minutes; log: %s\n' \
  "$package" "$version" "$tree/build.log" >&2
# The build has a process group of its own, which ends with this script; in the background `set -e`
# holds inside it.
set -m
(set -e; build) >"$tree/build.log" 2>&1 </dev/null {lock}>&- &
builder=$!
set +m
trap 'kill -TERM -- "-$builder" 2>/dev/null || true; rm -rf "$tree"' EXIT
status=0
wait "$builder" || status=$?
# Again: a cache may be emptied at any time.
mkdir -p "$place"
cp "$tree/build.log" "$place/build.log"
if ((status != 0)); then
  tail -n 40 "$place/build.log" >&2
  die "the kernel couldn't be built; all of its output: $place/build.log"
fi
# At once or not at all, also for one who doesn't look at the lock.
cp "$tree/linux" "$place/linux.new"
mv "$place/linux.new" "$place/linux"
printf '%s\n' "$place/linux"
