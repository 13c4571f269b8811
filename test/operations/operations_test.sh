#!/usr/bin/env bash
# Tests the installed commands, and a system that setup_system has prepared, without a running systemd.
set -euo pipefail

usage() {
  cat <<'END'
usage: test/operations/operations_test.sh PREFIX

PREFIX is an install space. Checks --help and the exit codes of every installed command; sets up an empty
root and checks it with systemd-analyze, udevadm and the node's messages; and runs the service's command
lines as an ordinary user with its limits. Without root, the parts that need it are skipped. Exit status
0: all passed; 1: otherwise.
END
}
case ${1:-} in
  -h | --help) usage && exit ;;
  '') usage >&2 && exit 2 ;;
esac
prefix=$(realpath "$1")
bin=$prefix/lib/stepdriver
config=$prefix/share/stepdriver/config

failures=0
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  failures=$((failures + 1))
}
scratch=$(mktemp -d)
jobs_started=()
finish() {
  local status=$? job
  # Not SIGKILL at first: a roscore that is killed leaves its master behind.
  kill -TERM "${jobs_started[@]}" 2>/dev/null || true
  for job in "${jobs_started[@]}"; do
    timeout 15 tail --pid="$job" -f /dev/null || kill -KILL "$job" 2>/dev/null || true
  done
  rm -rf "$scratch"
  exit "$status"
}
trap finish EXIT

# ends WANTED COMMAND...: runs a command, with its output in $output, and checks its exit status.
ends() {
  local wanted=$1 status=0
  shift
  output=$("$@" 2>&1 </dev/null) || status=$?
  ((status == wanted)) || fail "exit status $status, not $wanted: $*: $output"
}
says() { [[ $output == *"$1"* ]] || fail "\"$1\" isn't in: $output"; }

# ---- every command ----

for command in "$bin"/*; do
  [[ -f $command ]] || continue  # a folder that some of them share
  ends 0 "$command" --help
  says "usage: ${command##*/}"
  says "xit code"
  says "64 wrong usage"
  ends 64 "$command" --unheard-of
  says "usage: ${command##*/}"
done

printf 'axes: {x: {driver: a4989}}\n' >"$scratch/wrong.yaml"
ends 1 "$bin/stepdriver_check" --config "$scratch/wrong.yaml"
says 'is "a4989"'
ends 1 "$bin/stepdriver_check" --config "$scratch/none.yaml"

# ---- a machine that setup_system has set up ----

if (($(id -u) != 0)); then
  printf 'skipped without root: setup_system, the service\n'
  exit "$((failures > 0))"
fi
machine=$scratch/machine
mkdir -p "$machine/etc"
ends 1 "$bin/setup_system" --root "$scratch/none"
ends 0 "$bin/setup_system" --root "$machine"
ends 0 "$bin/setup_system" --root "$machine"
for entry in '^gpio:[^:]*:[0-9]*:stepdriver$' '^realtime:[^:]*:[0-9]*:stepdriver$'; do
  grep -q "$entry" "$machine/etc/group" || fail "no line $entry in: $(<"$machine/etc/group")"
done
grep -q '^stepdriver:' "$machine/etc/passwd" || fail "no user stepdriver"
units=$machine/etc/systemd/system
! grep -rl '@prefix@' "$machine/etc" || fail "@prefix@ is left in these"

# The limits that the node's messages recommend are the installed ones.
for limit in '@realtime - rtprio 50' '@realtime - memlock unlimited'; do
  grep -qxF -e "$limit" "$machine/etc/security/limits.d/stepdriver.conf" || fail "no limit $limit"
  grep -qF -e "$limit" "$bin/stepdriver_node" || fail "the node doesn't say $limit"
done

# The device that they name is open to the group, and allowed by the service's device policy.
latency=/dev/cpu_dma_latency
grep -qF "KERNEL==\"${latency##*/}\", GROUP=\"realtime\"" \
  "$machine/etc/udev/rules.d/60-stepdriver-gpio.rules" || fail "no rule for $latency"
grep -qx "DeviceAllow=$latency rw" "$units/stepdriver.service" || fail "the service can't open $latency"
grep -qF "$latency" "$bin/stepdriver_node" || fail "the node doesn't say $latency"

# systemd-analyze exits with 0 even after a warning.
for unit in stepdriver stepdriver-roscore; do
  output=$(systemd-analyze verify "$units/$unit.service" 2>&1) || fail "$unit.service: $output"
  [[ $output != *"$unit"* ]] || fail "$output"
  # The threshold is ten times the exposure level.
  ends 0 systemd-analyze security --no-pager --offline=true --threshold=30 "$units/$unit.service"
  says "Overall exposure level for $unit.service"
done
# What bounds a client that may connect: docs/security.md.
for limit in MemoryMax=512M LimitNOFILE=4096; do
  grep -qx "$limit" "$units/stepdriver.service" || fail "no line $limit in stepdriver.service"
done
# A new master knows nothing of the node.
grep -qx 'PartOf=stepdriver-roscore.service' "$units/stepdriver.service" || fail "the node doesn't follow its master"
grep -qx 'WantedBy=.* stepdriver-roscore.service' "$units/stepdriver.service" ||
  fail "the master doesn't start the node"
if udevadm verify --help >/dev/null 2>&1; then
  ends 0 udevadm verify --resolve-names=never "$machine/etc/udev/rules.d/60-stepdriver-gpio.rules"
fi

# ---- the service ----

# It runs as systemd would run it: as an ordinary user without capabilities, with the unit's limits and
# system calls. A refused call ends it here.

# unit_values KEY [UNIT]: the values of a key of the unit.
unit_values() { sed -n "s/^$1=-\{0,1\}//p" "$units/${2:-stepdriver}.service"; }
raised=(prlimit "--rtprio=$(unit_values LimitRTPRIO)" "--nofile=$(unit_values LimitNOFILE)"
  "--memlock=$(unit_values LimitMEMLOCK | sed s/infinity/unlimited/)")
chmod 755 "$scratch"
mkdir -m 777 "$scratch/state"
log_format=$(sed -n 's/^Environment="\(ROSCONSOLE_FORMAT=.*\)"$/\1/p' "$units/stepdriver.service")
ordinary=(setpriv --reuid 65534 --regid 65534 --clear-groups --bounding-set=-all --no-new-privs
  env "HOME=$scratch/state" "ROS_HOME=$scratch/state" "ROS_LOG_DIR=$scratch/state" "$log_format")
sandbox=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/sandbox.py
cp "$sandbox" "$units"/*.service "$scratch"
confined=(/usr/bin/python3 -B "$scratch/sandbox.py")
lines_of() { unit_values "$1" | sed "s|/etc/stepdriver/|$scratch/|g"; }

"${raised[@]}" true 2>/dev/null || raised=()  # a container may not
service=("${raised[@]}" "${ordinary[@]}" "${confined[@]}" "$scratch/stepdriver.service")
master=("${ordinary[@]}" "${confined[@]}" "$scratch/stepdriver-roscore.service")
ends 159 "${service[@]}" unshare --user true  # SIGSYS: the service is confined
"${service[@]}" test -x "$bin/stepdriver_node" || {
  printf 'skipped, because only root can reach %s: the service\n' "$prefix"
  exit "$((failures > 0))"
}
ends 0 "${service[@]}" "$bin/stepdriver_check" --config "$config/a4988.yaml" --backend simulated
if ((${#raised[@]} > 0)); then
  says "SCHED_FIFO 50; memory locked"
else
  printf 'skipped, because limits can'\''t be raised here: whether the limits of the service suffice\n'
fi

# Splits a line of a unit into words, which are quoted as in a shell.
words=()
words_of() { eval "words=($1)"; }
# start FILE: runs the lines of the unit with a configuration, and the node with its output in node.log.
start() {
  local line
  cp "$1" "$scratch/axes.yaml"
  while IFS= read -r line; do
    words_of "$line"
    "${service[@]}" "${words[@]}" >"$scratch/pre.log" 2>&1 || [[ $line == *delete* ]] ||
      fail "$line: $(<"$scratch/pre.log")"
  done < <(lines_of ExecStartPre)
  words_of "$(lines_of ExecStart)"
  "${service[@]}" "${words[@]}" >"$scratch/node.log" 2>&1 &
  node=$!
  jobs_started+=("$node")
}
# node_ends WANTED: waits for the node, and checks its exit status.
node_ends() {
  local status=0
  wait "$node" || status=$?
  ((status == $1)) || fail "the node ended with $status, not $1: $(<"$scratch/node.log")"
}

"${master[@]}" "$prefix/env.sh" roscore -p "${ROS_MASTER_URI##*:}" >"$scratch/roscore.log" 2>&1 &
jobs_started+=("$!")
words_of "$(unit_values ExecStartPost stepdriver-roscore)"
ends 0 timeout 60 "${master[@]}" "${words[@]}"

start "$scratch/wrong.yaml"
node_ends 1
{
  sed 's/GPIO\([0-9]\)/nowhere:\1/' "$config/a4988.yaml"
  printf 'gpio: {backend: libgpiod}\n'
} >"$scratch/elsewhere.yaml"
start "$scratch/elsewhere.yaml"
node_ends 2
{
  cat "$config/a4988.yaml"
  printf 'gpio: {backend: simulated}\n'
} >"$scratch/simulated.yaml"
# A parameter that the node doesn't know, left over from an earlier start.
ends 0 "$prefix/env.sh" rosparam set /stepdriver/left_over 1
start "$scratch/simulated.yaml"
for ((i = 0; i < 600; i++)); do
  ! grep -q Ready "$scratch/node.log" || break
  sleep 0.1
done
ends 0 timeout 60 "$prefix/env.sh" rosservice call /stepdriver/x/enable "data: true"
ends 0 timeout 60 "$prefix/env.sh" rosservice call /stepdriver/x/move_to "{position: 0.001, wait: true}"
says "success: True"
kill -TERM "$node" 2>/dev/null || true
node_ends 0
grep -q '\[ *INFO\] Ending on SIGTERM' "$scratch/node.log" ||
  fail "the node doesn't print why it ended: $(<"$scratch/node.log")"

((failures == 0)) || exit 1
printf 'the installed commands and the service are as they should be\n'
