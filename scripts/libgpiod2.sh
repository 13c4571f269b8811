#!/usr/bin/env bash
# Provides libgpiod 2 in addition to the system's libgpiod 1, for builds and tests with both.
set -euo pipefail

usage() {
  cat <<'END'
usage: scripts/libgpiod2.sh [-h]

Unpacks libgpiod 2 from the backports of this Debian into a folder outside the system, and prints that
folder, for the STEPDRIVER_GPIOD_ROOT of a build.

    cmake -S stepdriver_core -B build/gpiod2 -DSTEPDRIVER_GPIOD=2 \
      -DSTEPDRIVER_GPIOD_ROOT="$(scripts/libgpiod2.sh)"

If the system's own libgpiod is version 2, it prints an empty line. Nothing is installed, and apt's own
lists and sources remain unchanged. The folder is kept in ~/.cache/stepdriver/libgpiod2 (or
$XDG_CACHE_HOME/stepdriver/libgpiod2), one for each version, and used again. Exit status 77, with the
reason, if libgpiod 2 isn't available.
END
}
case ${1:-} in
  '') ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

export PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH" LC_ALL=C.UTF-8
missing() {
  printf 'libgpiod2.sh: libgpiod 2 is not available: %s\n' "$*" >&2
  exit 77
}

if grep -qs gpiod_api_version /usr/include/gpiod.h; then
  echo
  exit
fi

cache=${XDG_CACHE_HOME:-${HOME:?}/.cache}/stepdriver/libgpiod2
mkdir -p "$cache"
cache=$(cd "$cache" && pwd -P)
newest() { find "$cache" -mindepth 1 -maxdepth 1 -type d -name '[0-9]*' | sort -V | tail -n 1; }
found=$(newest)
if [[ -n $found ]]; then
  printf '%s\n' "$found"
  exit
fi

# ---- the source ----

for tool in apt-get apt-cache dpkg-deb; do
  command -v "$tool" >/dev/null || missing "there is no $tool: this isn't Debian"
done
# shellcheck disable=SC1091
suite=$(. /etc/os-release && [[ ${ID:-} == debian ]] && printf '%s' "${VERSION_CODENAME:-}") ||
  missing "this isn't Debian"
[[ -n $suite ]] || missing "/etc/os-release has no VERSION_CODENAME"
# shellcheck disable=SC2016
mirror=$(apt-get indextargets --format '$(LABEL) $(REPO_URI)' 2>/dev/null |
  sed -n 's/^Debian //p' | head -n 1) || true
mirror=${mirror:-http://deb.debian.org/debian}
keys=/usr/share/keyrings/debian-archive-keyring.gpg
[[ -r $keys ]] || missing "there is no $keys: install debian-archive-keyring"

# ---- the download: apt with lists and sources of its own ----

work=$(mktemp -d "$cache/.new.XXXXXX")
trap 'rm -rf "$work"' EXIT
mkdir -p "$work"/{lists,cache/archives}/partial "$work"/{root,debs,none}
: >"$work/status"
echo "deb [signed-by=$keys] ${mirror%/} $suite-backports main" >"$work/sources.list"
apt=(-o Dir::State="$work" -o Dir::State::lists="$work/lists" -o Dir::State::status="$work/status"
  -o Dir::Cache="$work/cache" -o Dir::Etc::sourcelist="$work/sources.list"
  -o Dir::Etc::sourceparts="$work/none" -o APT::Update::Error-Mode=any)
# apt's own user couldn't read the caller's folder.
(($(id -u) != 0)) || apt+=(-o APT::Sandbox::User=root)

apt-get "${apt[@]}" -q update >"$work/log" 2>&1 ||
  missing "$mirror $suite-backports doesn't answer: $(grep -m 1 '^[EW]:' "$work/log" || true)"
version=$(apt-cache "${apt[@]}" policy libgpiod-dev | sed -n 's/^ *Candidate: *//p')
[[ $version == 2.* ]] || missing "$suite-backports has libgpiod-dev ${version:-(none)}, not 2"
(cd "$work/debs" && apt-get "${apt[@]}" -q download libgpiod-dev libgpiod3) >"$work/log" 2>&1 ||
  missing "the download failed: $(grep -m 1 '^E:' "$work/log" || true)"
for package in "$work"/debs/*.deb; do dpkg-deb -x "$package" "$work/root"; done
grep -qs gpiod_api_version "$work/root/usr/include/gpiod.h" ||
  missing "the package libgpiod-dev $version has no gpiod.h of version 2"

# If another run was faster, its folder is kept.
mv -T "$work/root" "$cache/$version" 2>/dev/null || true
newest
