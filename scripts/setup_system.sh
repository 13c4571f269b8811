#!/usr/bin/env bash
# Prepares a machine to run the installed node as a service: groups, a device rule, limits and units.
set -euo pipefail

usage() {
  cat <<'END'
usage: setup_system [--root DIR]

Run it from an install space, as root: rosrun stepdriver setup_system. It creates the groups gpio and
realtime and the user stepdriver, and installs

  /etc/sysusers.d/stepdriver.conf             these groups and the user
  /etc/udev/rules.d/60-stepdriver-gpio.rules  gives /dev/gpiochip* to the group gpio, and
                                              /dev/cpu_dma_latency to the group realtime
  /etc/security/limits.d/stepdriver.conf      the limits of the pulse thread for the group realtime
  /etc/systemd/system/stepdriver.service      the node, with the parameters of
                                              /etc/stepdriver/axes.yaml
  /etc/systemd/system/stepdriver-roscore.service  a ROS master, for a machine without one

It enables and starts nothing. Run it again after an update.

  --root DIR  sets up the system that is mounted there

Exit codes: 0 done, 1 failed, 64 wrong usage.
END
}

die() {
  printf 'setup_system: %s\n' "$*" >&2
  exit 1
}

target=''
case ${1:-} in
  '') (($# == 0)) || { usage >&2 && exit 64; } ;;
  -h | --help) usage && exit ;;
  --root)
    (($# == 2)) || { usage >&2 && exit 64; }
    target=$2
    [[ -d $target ]] || die "--root $target isn't a folder"
    ;;
  *) usage >&2 && exit 64 ;;
esac

prefix=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../.." && pwd -P)
config=$prefix/share/stepdriver/config
[[ -x $prefix/env.sh && -d $config ]] ||
  die "$prefix isn't an install space: build the package with cmake --install or catkin_make install"
[[ $prefix != *[![:alnum:]/._+-]* ]] ||
  die "the install space is $prefix, but its path must have only letters, digits and / . _ + -"
(($(id -u) == 0)) || die "needs root: sudo $0"
command -v systemd-sysusers >/dev/null || die "needs systemd-sysusers, of the package systemd"

put() {
  install -D -m 644 "$config/$1" "$target/etc/$2"
  sed -i "s|@prefix@|$prefix|g" "$target/etc/$2"
  printf '%s\n' "/etc/$2"
}
put systemd/stepdriver.conf sysusers.d/stepdriver.conf
systemd-sysusers ${target:+"--root=$target"} stepdriver.conf
put udev/60-stepdriver-gpio.rules udev/rules.d/60-stepdriver-gpio.rules
put limits.d/stepdriver.conf security/limits.d/stepdriver.conf
put systemd/stepdriver.service systemd/system/stepdriver.service
put systemd/stepdriver-roscore.service systemd/system/stepdriver-roscore.service

if [[ -z $target && -d /run/systemd/system ]]; then
  systemctl daemon-reload
  udevadm control --reload
  udevadm trigger --subsystem-match=gpio
  udevadm trigger --sysname-match=cpu_dma_latency
fi
cat <<'END'
Next: copy your configuration to /etc/stepdriver/axes.yaml, then run
  systemctl enable --now stepdriver-roscore stepdriver
  usermod -aG gpio,realtime NAME    for each user who runs the node by hand; then log in again
END
