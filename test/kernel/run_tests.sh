# shellcheck shell=bash
# Sourced by the scripts of this folder whose tests are bash functions.

# run_tests NAME...: calls each function in its own subshell, under `set -e`, and prints its result.
# Returns 1 if one failed.
run_tests() {
  local test start status took failed=0
  for test; do
    start=$EPOCHREALTIME status=0
    # In the background, so that `set -e` applies inside the subshell.
    (set -e; "$test") &
    wait $! || status=$?
    took=$((${EPOCHREALTIME/./} - ${start/./}))
    printf '%-6s %5d ms  %s\n' "$( ((status == 0)) && echo ok || echo FAILED)" $((took / 1000)) "$test"
    ((status == 0)) || failed=$((failed + 1))
  done
  ((failed == 0))
}
