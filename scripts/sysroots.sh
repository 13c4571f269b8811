# shellcheck shell=bash
# Shared by cross.sh and package.sh: packages of another processor, unpacked into folders outside the system,
# which are kept for the next time in ~/.cache/stepdriver/cross (or $XDG_CACHE_HOME/stepdriver/cross).
# Sourced after common.sh, with the processor as Debian names it in `arch`. The script defines the function
# `missing`, which ends it and says what is missing.

# Gives apt lists of its own in the folder $1, and sets own_lists, which are its options.
use_own_lists() {
  mkdir -p "$1"/{lists,cache/archives}/partial
  : >"$1/status"
  # shellcheck disable=SC2154  # the script sets it
  own_lists=(-o APT::Architecture="$arch" -o APT::Architectures::="$arch" -o Dir::State="$1"
    -o Dir::State::lists="$1/lists" -o Dir::State::status="$1/status" -o Dir::Cache="$1/cache")
  # apt's own user couldn't read the caller's folder.
  (($(id -u) != 0)) || own_lists+=(-o APT::Sandbox::User=root)
  # Some of the lists may be enough.
  apt-get "${own_lists[@]}" -q update || true
}

# unpack_packages FOLDER PACKAGE...: unpacks the packages and what they depend on.
unpack_packages() {
  local sysroot=$1 work=$1/work file package
  shift
  use_own_lists "$work"
  apt-get "${own_lists[@]}" -q -y --no-install-recommends --download-only install "$@" || return
  for package in "$work"/cache/archives/*.deb; do
    dpkg-deb -x "$package" "$sysroot" && record_package "$package" "$sysroot/var/lib/dpkg" || return
  done
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
# record_package FILE FOLDER: adds a package to a database in dpkg's form, if it can be installed together with
# the same package for another processor.
record_package() {
  local name file
  [[ $(dpkg-deb -f "$1" Multi-Arch) == same ]] || return 0
  name=$(dpkg-deb -f "$1" Package):$arch
  mkdir -p "$2/info" &&
    { dpkg-deb -f "$1" && printf 'Status: install ok installed\n\n'; } >>"$2/status" &&
    dpkg-deb --fsys-tarfile "$1" | tar -t | sed -e 's/^\.//' -e 's|/$||' -e 's|^$|/.|' >"$2/info/$name.list" &&
    for file in symbols shlibs; do
      dpkg-deb -I "$1" "$file" >"$2/info/$name.$file" 2>/dev/null || rm "$2/info/$name.$file"
    done
}

cache=${XDG_CACHE_HOME:-${HOME:?}/.cache}/stepdriver/cross
mkdir -p "$cache"
cache=$(cd "$cache" && pwd -P)
# shellcheck disable=SC1091
release=$(. /etc/os-release && printf '%s' "${VERSION_CODENAME:-$ID}")
# keep NAME COMMAND...: sets `unpacked` to the folder of that name. If it doesn't exist yet, the command gets the
# path of a new one and fills it.
keep() {
  unpacked=$cache/$release-$1-$(md5sum <<<"${*:3}" | cut -c 1-8)  # other packages have a folder of their own
  [[ ! -d $unpacked ]] || return 0
  say "Unpacking packages of $arch into $unpacked"
  new=$(mktemp -d "$cache/.new.XXXXXX")
  # shellcheck disable=SC2154  # the script chooses it
  run "$2" "$new" "${@:3}" >"$build/log/cross-unpack.log" 2>&1
  # shellcheck disable=SC2154  # common.sh sets it
  ((run_status == 0)) || missing "packages can't be downloaded:" \
    "$(grep -m 1 '^[EW]:' "$build/log/cross-unpack.log" || tail -n 1 "$build/log/cross-unpack.log")"
  # If another run was faster, its folder is kept.
  mv -T "$new" "$unpacked" 2>/dev/null || rm -rf "$new"
}
remove_new() { [[ -z ${new:-} ]] || rm -rf "$new"; }
at_exit remove_new
