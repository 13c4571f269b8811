#!/usr/bin/env bash
# Tests the owner and mode that udev gives a GPIO chip by the rule that setup_system installs.
set -euo pipefail

usage() {
  cat <<'END'
usage: test/kernel/run.sh --chip rig:rig:8 -- bash test/operations/udev_test.sh

Runs only on the test kernel, and uses its first chip. By the rule, only the group gpio may use it. Exit
status 0: that is true; 1: otherwise.
END
}
case ${1:-} in
  -h | --help) usage && exit ;;
  '') ;;
  *) usage >&2 && exit 2 ;;
esac
rule=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../../config/udev/60-stepdriver-gpio.rules
gpio=4242
chip=/dev/gpiochip0
die() {
  printf 'udev_test: %s\n' "$*" >&2
  exit 1
}
[[ ${STEPDRIVER_GPIO_SIM:-} == 1 && -c $chip ]] || die "this isn't the test kernel: see --help"

# The host's files are visible here. These cover them, and disappear with this kernel.
mkdir -p /run/udev/rules.d
cp "$rule" /run/udev/rules.d/
sed '/^gpio:/d' /etc/group >/run/group
printf 'gpio:x:%s:\n' "$gpio" >>/run/group
mount --bind /run/group /etc/group

output=$(udevadm test --action=add /sys/bus/gpio/devices/gpiochip0 2>&1) || die "$output"
grep -Eq '60-stepdriver-gpio.rules:[0-9]+' <<<"$output" || die "the rule wasn't used: $output"
# Newer versions of udevadm only print what they would do.
owner=$(stat -c '%U:%g %a' "$chip")
if [[ $owner != "root:$gpio 660" ]]; then
  [[ $output == *"$gpio"* && $output == *0660* ]] || die "the chip is $owner: $output"
  chgrp "$gpio" "$chip"
  chmod 660 "$chip"
fi
# opens_it OPTION...: whether a user with these groups can open the chip for writing.
opens_it() {
  # shellcheck disable=SC2016
  setpriv --reuid 65534 --regid 65534 "$@" bash -c 'exec 3<>"$1"' opens_it "$chip" 2>/dev/null
}
opens_it --groups "$gpio" || die "the group gpio can't open it"
! opens_it --clear-groups || die "anyone can open it"
printf 'only the group gpio may use the chip\n'
