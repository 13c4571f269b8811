#!/usr/bin/env bash
# Records what the kernel does to its GPIO lines, with the tracepoints events/gpio. `run.sh --trace`
# calls it before and after a command. As root, it works on any machine whose kernel has the tracepoints.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: gpio_trace.sh start
       gpio_trace.sh stop FILE

start  begins an empty recording
stop   ends the recording and writes it to FILE: a line "# chip LABEL BASE LINES" for each GPIO chip,
       then the kernel's text, with times in nanoseconds of CLOCK_MONOTONIC. Fails if the kernel had
       to drop events
END_OF_USAGE
}

die() {
  printf 'gpio_trace.sh: %s\n' "$*" >&2
  exit 1
}

tracing=/sys/kernel/tracing
[[ -d $tracing/events/gpio ]] || die "this kernel has no gpio tracepoints in $tracing"

# Each write of a line takes 32 bytes, so the buffer has room for a million.
start() {
  echo 0 >"$tracing/tracing_on"
  echo mono >"$tracing/trace_clock"
  echo 32768 >"$tracing/buffer_size_kb"
  echo 0 >"$tracing/options/overwrite"
  : >"$tracing/trace"
  echo 1 >"$tracing/events/gpio/enable"
  echo 1 >"$tracing/tracing_on"
}

chips() {
  local chip label base lines
  for chip in /sys/class/gpio/gpiochip*; do
    [[ -d $chip ]] || continue
    read -r label <"$chip/label"
    read -r base <"$chip/base"
    read -r lines <"$chip/ngpio"
    printf '# chip %s %s %s\n' "$label" "$base" "$lines"
  done
}

# The kernel's text has times in microseconds; times in nanoseconds are only in the raw output. Both have
# the same events in the same order, so this puts the times of the raw output into the text.
in_nanoseconds() {
  local times=$1
  awk -v times="$times" '
    /^#/ { print; next }
    {
      do { found = (getline line <times) > 0 } while (found && line ~ /^#/)
      split(line, field, " ")
      if (!found || field[3] !~ /^[0-9]+$/ ||
          !match($0, / [0-9]+\.[0-9][0-9][0-9][0-9][0-9][0-9]: /)) {
        print "event " NR " has no time: " $0 >"/dev/stderr"
        exit 1
      }
      time = field[3]
      while (length(time) < 10) time = "0" time
      seconds = length(time) - 9
      print substr($0, 1, RSTART) substr(time, 1, seconds) "." substr(time, seconds + 1) \
        substr($0, RSTART + RLENGTH - 2)
    }
    END { if (found && (getline line <times) > 0) exit 1 }'
}

stop() {
  local file=$1 lost times
  echo 0 >"$tracing/tracing_on"
  echo 0 >"$tracing/events/gpio/enable"
  lost=$(awk '/^(overrun|commit overrun|dropped events):/ { sum += $NF } END { print sum + 0 }' \
    "$tracing"/per_cpu/cpu*/stats)
  times=$(mktemp)
  # shellcheck disable=SC2064
  trap "rm -f '$times'" EXIT
  echo 1 >"$tracing/options/raw"
  cat "$tracing/trace" >"$times"
  echo 0 >"$tracing/options/raw"
  { chips && in_nanoseconds "$times" <"$tracing/trace"; } >"$file" ||
    die "the trace couldn't be written to $file"
  ((lost == 0)) || die "the kernel dropped $lost events: the buffer has room for a million"
}

case "${1:-} $#" in
  'start 1' | 'stop 2') "$@" ;;
  '-h 1' | '--help 1') usage ;;
  *) usage >&2 && exit 2 ;;
esac
