# shellcheck shell=bash
# Sourced by the tests of this folder that are bash functions.

# run_tests NAME...: calls each function in a shell of its own, under `set -e`, and prints what
# became of it. False where one failed.
run_tests() {
  local test start status took failed=0
  for test; do
    start=$EPOCHREALTIME status=0
    # In the background `set -e` holds inside it.
    (set -e; "$test") &
    wait $! || status=$?
    took=$((${EPOCHREALTIME/./} - ${start/./}))
    printf '%-6s %5d ms  %s\n' "$( ((status == 0)) && echo ok || echo FAILED)" $((took / 1000)) "$test"
    ((status == 0)) || failed=$((failed + 1))
  done
  ((failed == 0))
}
