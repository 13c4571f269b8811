# shellcheck shell=bash
# Shared by test_in_root.sh and container.sh: clean systems made with debootstrap, kept for the next time in
# ~/.cache/stepdriver/roots, or in the folder that STEPDRIVER_ROOTS names. Sourced after common.sh.

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

# make_base_root bookworm|trixie|focal: a minimal system and nothing else. Sets
#   roots   the folder of these systems
#   base    this one; it must not be changed
#   mirror  where its packages are from
make_base_root() {
  local suite=$1 include=()
  command -v debootstrap >/dev/null || die "needs debootstrap: apt-get install debootstrap"
  roots=${STEPDRIVER_ROOTS:-${XDG_CACHE_HOME:-${HOME:-/root}/.cache}/stepdriver/roots}
  mkdir -p "$roots"
  roots=$(cd "$roots" && pwd -P)
  base=$roots/$suite
  if [[ $suite == focal ]]; then
    components=main,universe
    mirror=$(mirror_of Ubuntu http://archive.ubuntu.com/ubuntu)
    security_suite="$mirror $suite-security"
  else
    components=main
    mirror=$(mirror_of Debian http://deb.debian.org/debian)
    security_suite="$(mirror_of Debian-Security http://deb.debian.org/debian-security) $suite-security"
  fi
  [[ ! -d $base ]] || return 0

  say "Making $base from $mirror"
  rm -rf "$base.new"
  [[ $mirror != https* ]] || include=(--include=ca-certificates)
  run debootstrap --variant=minbase --components="$components" "${include[@]}" "$suite" "$base.new" \
    "$mirror" >"$base.log" 2>&1
  # shellcheck disable=SC2154  # common.sh sets it
  ((run_status == 0)) || die "debootstrap failed; its output: $base.log"
  mv "$base.new" "$base"
}

# connect_root FOLDER: apt in this copy of the base gets its packages as this machine's apt does.
connect_root() {
  local suite=${base##*/}
  cp -L /etc/resolv.conf "$1/etc/resolv.conf"
  apt_transport >"$1/etc/apt/apt.conf.d/90host"
  cat >"$1/etc/apt/sources.list" <<END
deb $mirror $suite ${components/,/ }
deb $mirror $suite-updates ${components/,/ }
deb $security_suite ${components/,/ }
END
}
