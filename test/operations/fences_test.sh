#!/usr/bin/env bash
# Tries the fences of docs/security.md: two computers, which are network namespaces joined by a cable.
set -euo pipefail

usage() {
  cat <<'END'
usage: test/operations/fences_test.sh PREFIX

PREFIX is an install space. Starts launch files on one computer, and tries from another one which ports it
reaches: with the defaults, with listen:=, behind the firewall of docs/security.md, and through ssh. Exit
status 0: all passed, or there is no root or no network namespace; 1: otherwise.
END
}
case ${1:-} in
  -h | --help) usage && exit ;;
  '') usage >&2 && exit 2 ;;
esac
prefix=$(realpath "$1")
page=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../../docs/security.md

failures=0
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  failures=$((failures + 1))
}
machine=stepdriver-machine-$$ other=stepdriver-other-$$
address=10.213.78.1 other_address=10.213.78.2
ip netns add "$machine" 2>/dev/null || {
  printf 'skipped, because there is no root or no network namespace: the fences\n'
  exit 0
}
scratch=$(mktemp -d)
jobs_started=()
end_jobs() {
  local job
  for job in "${jobs_started[@]}"; do
    kill -INT -- "-$job" 2>/dev/null || true
    timeout 30 tail --pid="$job" -f /dev/null || kill -KILL -- "-$job" 2>/dev/null || true
  done
  jobs_started=()
}
finish() {
  local status=$?
  end_jobs
  ip netns del "$machine"
  ip netns del "$other" 2>/dev/null || true
  rm -rf "$scratch"
  exit "$status"
}
trap finish EXIT
ip netns add "$other"
ip link add sd0 netns "$machine" type veth peer name sd0 netns "$other"
ip -n "$machine" address add "$address/24" dev sd0
ip -n "$other" address add "$other_address/24" dev sd0
for host in "$machine" "$other"; do
  ip -n "$host" link set lo up
  ip -n "$host" link set sd0 up
done

unset ROS_HOSTNAME
on_machine() { ip netns exec "$machine" env ROS_MASTER_URI=http://localhost:11311 ROS_IP=127.0.0.1 "$@"; }
# In a group of its own, because Ctrl-C goes to a group.
start() {
  local log=$scratch/$1.log
  shift
  : >"$log" # here, because the job may begin later than what waits for its words
  set -m
  "$@" >>"$log" 2>&1 </dev/null &
  set +m
  jobs_started=("$!" "${jobs_started[@]}")
}
# wait_for WHAT COMMAND...: repeats a command until it succeeds.
wait_for() {
  local what=$1 i
  shift
  for ((i = 0; i < 600; i++)); do
    ! "$@" >/dev/null 2>&1 || return 0
    sleep 0.1
  done
  fail "$what: $(tail -n 30 "$scratch"/*.log)"
  return 1
}
# launch ADDRESS LISTEN: starts axis.launch, and the master with it, in an environment with ROS_IP=ADDRESS.
launch() {
  start launch ip netns exec "$machine" env ROS_MASTER_URI="http://$1:11311" ROS_IP="$1" \
    roslaunch stepdriver axis.launch listen:="$2"
  wait_for "roslaunch starts no node" grep -q Ready "$scratch/launch.log"
}
# The names of the processes whose ports the other computer reaches, one line each.
reached() {
  local name port
  ip netns exec "$machine" ss -Htlnp | sed -n 's/^[^:]*:\([0-9]*\) .*users:(("\([^"]*\)".*/\1 \2/p' |
    while read -r port name; do
      ! ip netns exec "$other" timeout 2 bash -c "</dev/tcp/$address/$port" 2>/dev/null || printf '%s\n' "$name"
    done | sort -u
}
# expect_reached WHEN NAME...: the other computer reaches ports of these processes, and of no others.
expect_reached() {
  local when=$1 found expected i
  shift
  expected=$(printf '%s\n' "$@" | sort -u)
  # Again, because a busy computer may take longer than the time for a connection.
  for ((i = 0; i < 5; i++)); do
    found=$(reached)
    [[ $found != "$expected" ]] || return 0
  done
  fail "$when the other computer reaches ${found//$'\n'/, }; expected: $*"
}
position='{position: 0.001, wait: true}'

# ---- on the loopback ----

# The names are those of the kernel, with 15 characters.
launch 127.0.0.1 127.0.0.1
expect_reached "on the loopback" robot_state_pub rosout
port=$(on_machine rosservice uri /stepdriver/x/move_to | sed 's/.*://')

# ---- through ssh ----

# dropbear is a server without settings: the files of its user are in a folder that only it sees.
keys=$scratch/keys
mkdir -m 700 "$keys"
ssh-keygen -q -t ed25519 -N '' -f "$keys/client"
dropbearkey -t ed25519 -f "$keys/host" >/dev/null
cat >"$scratch/server.sh" <<END
set -e
mount --bind "$keys" "\$HOME"
mkdir -m 700 "\$HOME/.ssh"
install -m 600 "$keys/client.pub" "\$HOME/.ssh/authorized_keys"
exec dropbear -F -E -m -s -r "$keys/host" -p $address:2022 -P "$scratch/dropbear.pid"
END
start server ip netns exec "$machine" unshare --mount env "HOME=$(getent passwd root | cut -d: -f6)" \
  sh "$scratch/server.sh"
through_ssh=(ip netns exec "$other" ssh -F none -i "$keys/client" -p 2022 -o BatchMode=yes
  -o StrictHostKeyChecking=no -o "UserKnownHostsFile=$scratch/known_hosts")
wait_for "ssh" "${through_ssh[@]}" "root@$address" true

answer=$("${through_ssh[@]}" "root@$address" "ROS_IP=127.0.0.1 ROS_HOME=$scratch $prefix/env.sh \
  rosservice call /stepdriver/x/enable 'data: true'" 2>&1) || true
[[ $answer == *"success: True"* ]] || fail "a call on the machine through ssh: $answer"

start tunnel "${through_ssh[@]}" -N -L 11311:localhost:11311 -L "$port:localhost:$port" "root@$address"
on_other() { ip netns exec "$other" env ROS_MASTER_URI=http://localhost:11311 ROS_IP=127.0.0.1 "$@"; }
wait_for "the tunnel" on_other rosparam get /rosversion
answer=$(on_other timeout 60 rosservice call /stepdriver/x/move_to "$position" 2>&1) || true
[[ $answer == *"success: True"* ]] || fail "a call through the tunnel: $answer"
end_jobs

# ---- a master that others reach, and a node that they don't ----

launch "$address" 127.0.0.1
expect_reached "with ROS_IP=$address and listen:=127.0.0.1" robot_state_pub roslaunch rosmaster rosout
from_other=(ip netns exec "$other" env "ROS_MASTER_URI=http://$address:11311" "ROS_IP=$other_address")
start publisher "${from_other[@]}" rostopic pub -r 10 /stepdriver/jog stepdriver/Jog '{name: [x], velocity: [0.01]}'
wait_for "the node doesn't refuse the other computer's topic" \
  grep -q "a requested connection to '$other_address' is being rejected" "$scratch/launch.log"
end_jobs

# ---- two computers, and the firewall between them ----

launch "$address" "$address"
expect_reached "with listen:=$address" robot_state_pub roslaunch rosmaster rosout stepdriver_node
answer=$("${from_other[@]}" timeout 60 rosservice call /stepdriver/x/enable 'data: true' 2>&1) || true
[[ $answer == *"success: True"* ]] || fail "a call from the other computer: $answer"

# firewall ADDRESS: the rules of the page, with this address as that of the computer that may call.
firewall() {
  # shellcheck disable=SC2016  # these are Markdown's.
  sed -n '/^```nft$/,/^```$/{/^```/d;p}' "$page" | sed "s/192\.0\.2\.7/$1/" >"$scratch/rules.nft"
  grep -q "$1" "$scratch/rules.nft" || fail "the page has no rules for 192.0.2.7"
  ip netns exec "$machine" nft flush ruleset
  ip netns exec "$machine" nft -f "$scratch/rules.nft" || fail "nft refuses the rules of the page"
}
firewall 192.0.2.7
expect_reached "behind the firewall" ''
answer=$(ip netns exec "$machine" env "ROS_MASTER_URI=http://$address:11311" "ROS_IP=$address" \
  timeout 60 rosservice call /stepdriver/x/move_to "$position" 2>&1) || true
[[ $answer == *"success: True"* ]] || fail "a call on the machine behind the firewall: $answer"
firewall "$other_address"
answer=$("${from_other[@]}" timeout 60 rosservice call /stepdriver/x/move_to "$position" 2>&1) || true
[[ $answer == *"success: True"* ]] || fail "a call from the computer that may call: $answer"

((failures == 0)) || exit 1
printf 'the fences keep out and let in what they should\n'
