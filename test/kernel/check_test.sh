#!/usr/bin/env bash
# Runs stepdriver_check on the test kernel, in virtual time, with simulated GPIO chips, and compares its
# output with the kernel's own account of their lines.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/kernel/check_test.sh STEPDRIVER_CHECK CHECK_WAVEFORM

CMake builds both programs, the second one from check_waveform.cpp. Exit status 0: all passed; 1: a test
failed; 77: this machine can't run the test kernel.
END_OF_USAGE
}

here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd -P)
this=$here/$(basename "${BASH_SOURCE[0]}")
# shellcheck source=test/kernel/run_tests.sh
source "$here/run_tests.sh"

fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}

# ---- inside: commands that run.sh runs ----

is_held() { gpioinfo | grep -E "X_DIR.*gpioset" >/dev/null; }

# Another program holds a line.
inside_held() {
  local chip holder status=0 i
  chip=$(basename "$("$GPIO_SIM" path rig)")
  if [[ $(gpiodetect --version) == *' v1.'* ]]; then
    gpioset --mode=signal "$chip" 2=0 &
  else
    gpioset -c "$chip" 2=0 &
  fi
  holder=$!
  for ((i = 0; i < 500; i++)); do
    ! is_held || break
    sleep 0.02
  done
  "$@" || status=$?
  kill "$holder"
  return "$status"
}

# Interrupts the command two seconds after the axis began to move.
inside_interrupted() {
  local status=0
  "$@" &
  sleep 5
  kill -INT $!
  wait $! || status=$?
  return "$status"
}

# ---- outside ----

chips=(--chip 'motors:rig:16:1=X_STEP,2=X_DIR,3=X_ENABLE'
  --chip 'switches:ends:8:2=X_MIN,3=X_MAX')

# configuration MAX_SPEED_MM_S [MORE]: writes an axis with 80 steps/mm to $scratch/axis.yaml.
configuration() {
  cat >"$scratch/axis.yaml" <<END
axes:
  x:
    driver: a4988
    pins: {step: X_STEP, dir: X_DIR, enable: "rig:3"}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: $1
    acceleration_mm_s2: 100.0
    timing: {step_high_us: 0.1, step_low_us: 0.1}
    endstops:
      min: {pin: X_MIN, active_level: high}
      max: {pin: X_MAX, active_level: high}
${2:-}
END
}

# ends STATUS COMMAND...: runs a command on that kernel, with its output in $scratch/out.
ends() {
  local wanted=$1 status=0
  shift
  bash "$here/run.sh" "${chips[@]}" --time-travel --timeout 100 --trace "$scratch/trace" -- "$@" \
    >"$scratch/out" 2>&1 || status=$?
  ((status == wanted)) || fail "exit status $status, not $wanted: $(<"$scratch/out")"
}
checks() {
  local wanted=$1
  shift
  ends "$wanted" "$stepdriver_check" --config "$scratch/axis.yaml" "$@"
}
says() { grep -qE -e "$1" "$scratch/out" || fail "not printed: $1; the output: $(<"$scratch/out")"; }

# edges OFFSET LEVEL: how often the line of the chip `rig` changed to this level.
edges() {
  awk -v offset="$1" -v level="$2" '
    /^# chip rig / { line = $4 + offset }
    match($0, /gpio_value: [0-9]+ set [01]/) {
      split(substr($0, RSTART, RLENGTH), word, " ")
      if (word[2] != line) next
      if (seen && word[4] == level && last != level) ++count
      last = word[4]
      seen = 1
    }
    END { if (seen) print count + 0; else print "never driven" }' "$scratch/trace"
}
no_edge_at_all() {
  local offset level
  for offset in 1 2 3; do
    for level in 0 1; do
      [[ $(edges "$offset" "$level") == 0 ]] || fail "line $offset: $(edges "$offset" "$level") edges"
    done
  done
}

finds_everything_in_order_without_an_edge() {
  configuration 10.0
  checks 0
  says 'x/step +X_STEP +gpiochip[0-9]+:1 +free'
  says 'x/endstops/max +X_MAX +gpiochip[0-9]+:3 +free'
  says 'write of x/step'
  says 'read of an endstop of x'
  says 'SCHED_FIFO 50'
  says '^  x +800 .* ok$'
  says '^Good: '
  no_edge_at_all
}

says_who_holds_a_line_and_measures_the_wake_ups() {
  configuration 10.0
  ends 2 bash "$this" --inside held "$stepdriver_check" --config "$scratch/axis.yaml"
  says 'x/dir +X_DIR +gpiochip[0-9]+:2 +held by "gpioset"'
  says 'Stop that program'
  says 'lateness of a wake-up'
  says '^NOT GOOD: 1 line '
}

says_which_chips_there_are_if_one_is_missing() {
  configuration 10.0
  sed -i 's/rig:3/no-such-chip:3/' "$scratch/axis.yaml"
  checks 2
  says 'x/enable +no-such-chip:3 +not found'
  says 'no chip with the name or label no-such-chip. There are: gpiochip'
}

says_which_axis_asks_for_too_much() {
  configuration 12500.0
  checks 3
  says '^  x +1000000 .* TOO FAST$'
  says '^NOT GOOD: .*top speed of x\.'
  no_edge_at_all
}

lists_what_is_wrong_in_the_configuration() {
  configuration -1
  checks 1
  says 'axes/x/max_speed_mm_s is -1'
}

moves_nothing_on_the_simulated_rig() {
  configuration 10.0 'gpio: {backend: simulated}'
  checks 4 --move
  says 'selects the simulated rig'
  [[ $(edges 1 1) == 'never driven' ]] || fail "lines were driven"
}

moves_exactly_forth_and_back() {
  configuration 10.0
  checks 0 --move
  says '160 pulses, 0 slips'
  says 'back where it was'
  [[ $(edges 1 1) == 160 ]] || fail "$(edges 1 1) rising edges"
  "$check_waveform" "$scratch/trace" --axis x --driver a4988 --step rig:1 --dir rig:2 --enable rig:3 \
    --expect-position 0 >"$scratch/waveform" || fail "$(<"$scratch/waveform")"
  grep -q '80 forward, 80 backward' "$scratch/waveform" || fail "$(<"$scratch/waveform")"
}

ends_a_move_disabled_where_it_is_interrupted() {
  local pulses
  configuration 10.0
  ends 4 bash "$this" --inside interrupted "$stepdriver_check" --config "$scratch/axis.yaml" --move \
    --distance 100
  says 'interrupted: decelerating'
  pulses=$(edges 1 1)
  ((pulses > 0 && pulses < 8000)) || fail "$pulses rising edges"
  [[ $(edges 1 0) == "$pulses" ]] || fail "STEP was left high"
  [[ $(edges 3 0) == 1 && $(edges 3 1) == 1 ]] || fail "ENABLE was left on"
}

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
(($# == 2)) || { usage >&2 && exit 2; }
stepdriver_check=$(realpath "$1")
check_waveform=$(realpath "$2")

bash "$here/run.sh" --check || exit
scratch=$(mktemp -d /var/tmp/stepdriver-check-test.XXXXXX)
trap 'rm -rf "$scratch"' EXIT

run_tests finds_everything_in_order_without_an_edge \
  says_who_holds_a_line_and_measures_the_wake_ups \
  says_which_chips_there_are_if_one_is_missing says_which_axis_asks_for_too_much \
  lists_what_is_wrong_in_the_configuration moves_nothing_on_the_simulated_rig \
  moves_exactly_forth_and_back ends_a_move_disabled_where_it_is_interrupted
