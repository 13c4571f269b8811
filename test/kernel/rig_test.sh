#!/usr/bin/env bash
# Tests the test kernel and its chips with libgpiod's own tools: other tests rely on them.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/kernel/rig_test.sh TRACE_TO_VCD

TRACE_TO_VCD is the program that CMake builds from trace_to_vcd.cpp. Exit status 0: all passed; 1: a test
failed; 77: this machine can't run the test kernel.
END_OF_USAGE
}

here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd -P)
this=$here/$(basename "${BASH_SOURCE[0]}")
# shellcheck source=test/kernel/run_tests.sh
source "$here/run_tests.sh"

# ---- inside: commands that run.sh runs ----

fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}

# until_true SECONDS COMMAND...: repeats a command until it succeeds.
until_true() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    ((SECONDS < end)) || fail "still false: $*"
    sleep 0.02
  done
}

# The tools of libgpiod 2 don't accept labels.
chip_of() { basename "$("$GPIO_SIM" path "$1")"; }

# The tools of libgpiod 1 and 2 take different arguments.
libgpiod_1() { [[ $(gpiodetect --version) == *' v1.'* ]]; }

# Sets lines, OFFSET=VALUE, and holds them until the process is told to end.
hold_lines() {
  local chip
  chip=$(chip_of "$1")
  shift
  if libgpiod_1; then exec gpioset --mode=signal "$chip" "$@"; else exec gpioset -c "$chip" "$@"; fi
}
set_once() {
  local chip
  chip=$(chip_of "$1")
  shift
  if libgpiod_1; then gpioset "$chip" "$@"; else gpioset -t 0 -c "$chip" "$@"; fi
}
wait_for_edge() {
  local chip
  chip=$(chip_of "$1")
  if libgpiod_1; then exec gpiomon -n 1 -r "$chip" "$2"; else exec gpiomon -n 1 -e rising -c "$chip" "$2"; fi
}
level_of() {
  local chip
  chip=$(chip_of "$1")
  if libgpiod_1; then gpioget "$chip" "$2"; else gpioget --numeric -c "$chip" "$2"; fi
}

has_level() { [[ $("$GPIO_SIM" value "$1" "$2") == "$3" ]]; }
is_held_by() { gpioinfo | grep -E "$1" >/dev/null; }

inside_lines() {
  local holder watcher
  gpioinfo | grep -F X_STEP >/dev/null || fail "libgpiod doesn't see the line's name"

  hold_lines rig 1=1 2=0 3=1 &
  holder=$!
  until_true 10 has_level rig 1 1
  until_true 10 has_level rig 3 1
  has_level rig 2 0 || fail "line 2 isn't low"
  kill "$holder"
  wait "$holder" || true

  [[ $(level_of ends 2) == 0 ]] || fail "the endstop is pressed from the start"
  wait_for_edge ends 2 >"$1" &
  watcher=$!
  until_true 10 is_held_by gpiomon
  "$GPIO_SIM" pull ends 2 up
  wait "$watcher"
  grep -i rising "$1" >/dev/null || fail "the edge was not a rising one: $(cat "$1")"
  [[ $(level_of ends 2) == 1 ]] || fail "the pressed endstop reads low"
  "$GPIO_SIM" pull ends 2 down
  [[ $(level_of ends 2) == 0 ]] || fail "the released endstop reads high"
}

inside_unplugged() {
  "$GPIO_SIM" remove rig
  ! is_held_by X_STEP || fail "the chip is still there"
  is_held_by X_MIN || fail "the other chip went too"
}

inside_toggles() {
  set_once rig 1=0
  sleep 100
  set_once rig 1=1
  sleep 100
  set_once rig 1=0
}

# A real-time thread that is awake for some microseconds around each of 300 ticks of 10 ms.
inside_ticks() {
  python3 - <<'END_OF_PROGRAM'
import os, sys, time

TICK, AROUND = 10_000_000, 5_000
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
due, worst = (time.monotonic_ns() // TICK + 2) * TICK, 0
for _ in range(300):
    time.sleep(max(0, due - AROUND - time.monotonic_ns()) / 1e9)
    while time.monotonic_ns() < due + AROUND:
        pass
    worst = max(worst, time.monotonic_ns() - due - AROUND)
    due += TICK
if worst > AROUND:
    sys.exit(f"FAILED: {worst} ns late")
END_OF_PROGRAM
}

# ---- outside ----

chips=(--chip 'motors:rig:16:1=X_STEP,2=X_DIR' --chip 'switches:ends:8:2=X_MIN')
rig() { bash "$here/run.sh" "$@"; }

passes_the_exit_status() {
  local status=0
  rig -- bash -c 'exit 7' || status=$?
  ((status == 7)) || fail "exit status $status, not 7"
}

passes_the_output_unchanged() {
  rig -- seq 200000 | cmp - <(seq 200000)
  [[ $(rig -- bash -c 'echo out; echo err >&2' 2>/dev/null) == out ]]
}

passes_environment_and_arguments() {
  local value='a  b
c' got
  # shellcheck disable=SC2016
  got=$(VALUE=$value rig --directory / -- bash -c 'printf "%s|%s|%s" "$VALUE" "$1" "$PWD"' - "x 'y")
  [[ $got == "$value|x 'y|/" ]] || fail "got: $got"
}

ends_a_command_that_hangs() {
  local status=0
  rig --timeout 2 -- sleep 1000 2>"$scratch/errors" || status=$?
  ((status == 124)) || fail "exit status $status, not 124"
  grep -q 'ended after 2 s' "$scratch/errors" || fail "no message: $(cat "$scratch/errors")"
}

says_that_the_kernel_died() {
  local status=0
  # shellcheck disable=SC2016
  rig --memory 64 -- bash -c 'echo 1 >/proc/sys/vm/panic_on_oom; x=xxxxxxxx; while :; do x=$x$x; done' \
    2>"$scratch/errors" || status=$?
  ((status == 125)) || fail "exit status $status, not 125"
  grep -q 'the kernel died' "$scratch/errors" || fail "no message: $(cat "$scratch/errors")"
}

drives_and_reads_lines_of_two_chips() {
  rig "${chips[@]}" --trace "$scratch/lines" -- bash "$this" --inside lines "$scratch/edge"
  "$trace_to_vcd" "$scratch/lines" "$scratch/lines.vcd" x.step=rig:1 x.dir=rig:2 x.endstop_min=ends:2
  sed -n '/^\$var/p; /^\$dumpvars/,$p' "$scratch/lines.vcd" | sed 's/^#[1-9].*/#/' >"$scratch/shape"
  cmp "$scratch/shape" - <<'END_OF_SHAPE' || fail "$(cat "$scratch/lines.vcd")"
$var wire 1 a step $end
$var wire 1 b dir $end
$var wire 1 c endstop_min $end
$dumpvars
1a
0b
0c
$end
#
1c
#
0c
#
END_OF_SHAPE
}

takes_a_chip_away() { rig "${chips[@]}" -- bash "$this" --inside unplugged; }

virtual_time_is_exact_and_repeats() {
  local run step
  for run in 1 2; do
    rig "${chips[@]}" --time-travel --timeout 60 --trace "$scratch/virtual$run" -- \
      bash "$this" --inside toggles
    "$trace_to_vcd" "$scratch/virtual$run" "$scratch/virtual$run.vcd" x.step=rig:1
  done
  cmp "$scratch/virtual1.vcd" "$scratch/virtual2.vcd"
  # Calculating takes no time: only reads of the clock add to the 100 s.
  step=$(sed -n 's/^#\(1[0-9]*\)$/\1/p' "$scratch/virtual1.vcd" | head -n 1)
  ((step >= 100000000000 && step < 100010000000)) || fail "100 s of sleep took $step ns"
}

# Every step of a motion may coincide with a tick.
virtual_time_never_throttles() { rig --time-travel --timeout 60 -- bash "$this" --inside ticks; }

# ---- all of it ----

case "${1:-}" in
  --inside)
    what=$2
    shift 2
    "inside_$what" "$@"
    exit
    ;;
  -h | --help) usage && exit ;;
esac
(($# == 1)) || { usage >&2 && exit 2; }
trace_to_vcd=$(realpath "$1")

rig --check || exit
scratch=$(mktemp -d /var/tmp/stepdriver-rig-test.XXXXXX)
trap 'rm -rf "$scratch"' EXIT

run_tests passes_the_exit_status passes_the_output_unchanged passes_environment_and_arguments \
  ends_a_command_that_hangs says_that_the_kernel_died drives_and_reads_lines_of_two_chips \
  takes_a_chip_away virtual_time_is_exact_and_repeats virtual_time_never_throttles
