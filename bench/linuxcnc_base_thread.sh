#!/usr/bin/env bash
# Measures how late LinuxCNC's base thread is on this computer, if linuxcnc-uspace is installed: for each
# rate of bench/paced.cpp, the largest error of one period according to LinuxCNC's component timedelta.
# Prints one line for each rate. Without LinuxCNC it prints that, and exits with 0.
set -euo pipefail

usage() {
  cat <<'END'
usage: bench/linuxcnc_base_thread.sh [SECONDS]

Runs LinuxCNC's base thread for SECONDS (default: 1) at each of the rates that bench/paced runs at.
END
}

case ${1:-} in
  -h | --help) usage && exit ;;
  '' | [0-9]*) seconds=${1:-1} ;;
  *) usage >&2 && exit 2 ;;
esac
command -v halrun >/dev/null || { echo "linuxcnc-uspace isn't installed, so there is no base thread to compare with" && exit; }

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
# LinuxCNC refuses to run as root.
as_user=()
(($(id -u) != 0)) || as_user=(setpriv --reuid nobody --regid nogroup --clear-groups env "HOME=$folder/home")
mkdir -m 777 "$folder/home"

printf '%-20s %8s %12s\n' 'LinuxCNC' 'Hz' 'off by [us]'
for rate in 1000 5000 10000 16000 20000 40000; do
  cat >"$folder/base.hal" <<END
loadrt threads name1=base period1=$((1000000000 / rate))
loadrt timedelta
addf timedelta.0 base
start
loadusr -w sleep $seconds
getp timedelta.0.jitter
END
  said=$(cd "$folder/home" && "${as_user[@]}" halrun -f "$folder/base.hal" 2>&1) || { echo "$said" >&2 && exit 1; }
  jitter=$(grep -Eo '^-?[0-9]+$' <<<"$said" | tail -n 1)
  kind='base thread'
  ! grep -q 'non-realtime' <<<"$said" || kind='base thread, not RT'
  printf '%-20s %8d %12.1f\n' "$kind" "$rate" "$(awk "BEGIN { print $jitter / 1000 }")"
done
