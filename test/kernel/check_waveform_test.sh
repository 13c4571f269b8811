#!/usr/bin/env bash
# Checks the output and exit codes of check_waveform for a trace that is written by hand.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/kernel/check_waveform_test.sh [EMULATOR...] CHECK_WAVEFORM

CHECK_WAVEFORM is the program that CMake builds from check_waveform.cpp. If it is for another processor,
the command that runs it comes first.
END_OF_USAGE
}
(($# > 0)) || { usage >&2 && exit 2; }
check_waveform=("$@")

fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# Two pulses backward and one forward, of 2 us: too short for a TB6600.
{
  echo '# chip rig 496 8'
  while read -r time line level; do
    printf '  pulse-37 [000] ..... 1.%09d: gpio_value: %d set %d\n' "$time" "$line" "$level"
  done <<'END_OF_EVENTS'
0 497 0
100 498 0
200 499 0
100000 497 1
102000 497 0
200000 497 1
202000 497 0
210000 498 1
300000 497 1
302000 497 0
END_OF_EVENTS
} >"$scratch/trace"

# ends STATUS ARGUMENT...
ends() {
  local wanted=$1 status=0
  shift
  "${check_waveform[@]}" "$scratch/trace" "$@" >"$scratch/out" 2>&1 || status=$?
  ((status == wanted)) || fail "exit status $status, not $wanted: $* gives: $(<"$scratch/out")"
}
says() { grep -qF -e "$1" "$scratch/out" || fail "not printed: $1; the output: $(<"$scratch/out")"; }

lines=(--step rig:1 --dir rig:2 --enable rig:3)
a4988=(--axis x --driver a4988 "${lines[@]}")
tb6600=(--axis y --driver tb6600 "${lines[@]}")

ends 0 "${a4988[@]}" --expect-position -1
says 'pulses: 1 forward, 2 backward; position -1'
says 'violations: 0'
ends 1 "${a4988[@]}" --expect-position 1
says 'the position should be 1'
ends 1 "${a4988[@]}" --shortest-interval 100001
ends 0 "${a4988[@]}" --inverted dir --expect-position 1
ends 1 "${a4988[@]}" --inverted dir,enable
says '3 x STEP while not enabled'
ends 1 "${tb6600[@]}" --inverted enable
ends 1 "${a4988[@]}" "${tb6600[@]}"
says '3 x STEP high time'
ends 1 "${tb6600[@]}" "${a4988[@]}"

ends 2 --axis x --driver a4989 "${lines[@]}"
says 'a4988, drv8825, tb6600'
ends 2 --axis x --driver a4988 --step rig:1
ends 2 --axis x --driver a4988 --step rig:9 --dir rig:2
ends 2 --axis x --driver a4988 --step rig:1 --dir rig:7
ends 2 "${a4988[@]}" --inverted sleep
ends 2 "${a4988[@]}" --expect-position 1.5
ends 2 "${a4988[@]}" --expect-position
ends 2 --driver a4988
ends 2 "${a4988[@]}" --speed 1
