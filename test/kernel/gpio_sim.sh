#!/usr/bin/env bash
# Makes simulated GPIO chips (the kernel's gpio-sim), and plays what is wired to their lines. run.sh makes
# its chips with this script; on the test kernel, $GPIO_SIM is its path.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: gpio_sim.sh create NAME:LABEL:LINES[:OFFSET=LINE_NAME,...]
       gpio_sim.sh pull LABEL OFFSET up|down
       gpio_sim.sh value LABEL OFFSET
       gpio_sim.sh base LABEL
       gpio_sim.sh path LABEL
       gpio_sim.sh remove LABEL

create  makes a chip: NAME is its device in configfs, LABEL is the label by which libgpiod finds it
pull    drives an input from outside, for example to press an endstop
value   prints the level of a line, 0 or 1, whoever drives it
base    prints the number of the chip's first line in the gpio tracepoints
path    prints the chip's folder in sysfs; sim_gpio<OFFSET>/pull and /value are in it
remove  removes the chip, as if its cable were pulled out
END_OF_USAGE
}

die() {
  printf 'gpio_sim.sh: %s\n' "$*" >&2
  exit 1
}

configs=/sys/kernel/config/gpio-sim

create() {
  local name label lines names rest device number
  IFS=: read -r name label lines names rest <<<"$1"
  [[ -n $name && -n $label && $lines =~ ^[0-9]+$ && -z $rest ]] ||
    die "$1 isn't NAME:LABEL:LINES[:OFFSET=LINE_NAME,...]"
  [[ -d $configs ]] || die "this kernel has no gpio-sim"
  device=$configs/$name
  mkdir "$device" "$device/bank0" || die "the chip $name can't be made"
  echo "$label" >"$device/bank0/label"
  echo "$lines" >"$device/bank0/num_lines"
  while IFS='=' read -r -d , number name; do
    [[ $number =~ ^[0-9]+$ && -n $name ]] || die "$number=$name isn't OFFSET=LINE_NAME"
    ((number < lines)) || die "the chip $label has no line $number: it has $lines"
    mkdir "$device/bank0/line$number"
    echo "$name" >"$device/bank0/line$number/name"
  done <<<"${names:+$names,}"
  echo 1 >"$device/live" || die "the chip $label can't be activated"
}

# The configfs folder of the chip with that label.
config_of() {
  local file label
  for file in "$configs"/*/bank0/label; do
    if [[ -f $file ]] && read -r label <"$file" && [[ $label == "$1" ]]; then
      printf '%s\n' "${file%/bank0/label}"
      return
    fi
  done
  die "there is no simulated chip with the label $1"
}

path() {
  local config device chip
  config=$(config_of "$1")
  read -r device <"$config/dev_name"
  read -r chip <"$config/bank0/chip_name"
  printf '%s\n' "/sys/devices/platform/$device/$chip"
}

line_file() {
  local chip
  chip=$(path "$1")
  [[ -d $chip/sim_gpio$2 ]] || die "the chip $1 has no line $2"
  printf '%s\n' "$chip/sim_gpio$2/$3"
}

base() {
  local chip label
  for chip in /sys/class/gpio/gpiochip*; do
    read -r label <"$chip/label"
    [[ $label == "$1" ]] || continue
    cat "$chip/base"
    return
  done
  die "there is no chip with the label $1"
}

pull() {
  local file
  [[ $3 == up || $3 == down ]] || die "$3 isn't up or down"
  file=$(line_file "$1" "$2" pull)
  echo "pull-$3" >"$file"
}

value() {
  local file
  file=$(line_file "$1" "$2" value)
  cat "$file"
}

remove() {
  local config
  config=$(config_of "$1")
  echo 0 >"$config/live"
}

case "${1:-} $#" in
  'create 2' | 'base 2' | 'path 2' | 'remove 2' | 'value 3' | 'pull 4') "$@" ;;
  '-h 1' | '--help 1') usage ;;
  *) usage >&2 && exit 2 ;;
esac
