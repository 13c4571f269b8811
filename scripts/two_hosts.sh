#!/usr/bin/env bash
# Measures nodes on two hosts with one master. The hosts are network namespaces that a cable joins.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/two_hosts.sh

Makes two network namespaces. Starts a master and four nodes of six axes in one of them, and a fifth node
and a client of all nodes in the other. Prints how long it took until the client heard each node, the
rates of their joint_states in the other namespace, and the figures of node_bench there. Needs root, and
the build of scripts/node_bench.sh (STEPDRIVER_CATKIN names another one).
END
}

case ${1:-} in
  '') ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac
(($(id -u) == 0)) || die "needs root, for network namespaces: sudo $0"

choose_build_folder
install_packages core ros bench
catkin=${STEPDRIVER_CATKIN:-$build/bench/catkin}
node=$catkin/devel/lib/stepdriver/stepdriver_node
[[ -x $node && -x $catkin/devel/lib/stepdriver/node_listener ]] || die "$node doesn't exist: run scripts/node_bench.sh first"
configuration=$build/bench/node_6.yaml
[[ -f $configuration ]] || die "$configuration doesn't exist: run scripts/node_bench.sh first"
use_ros "$catkin/devel"
nodes=4
seconds=8

host_a=stepdriver-a-$$ host_b=stepdriver-b-$$
address_a=10.213.77.1 address_b=10.213.77.2
jobs_started=()
clean_up() {
  local job
  for job in "${jobs_started[@]}"; do end_group "$job" 10; done
  ip netns del "$host_a" 2>/dev/null || true
  ip netns del "$host_b" 2>/dev/null || true
}
at_exit clean_up
ip netns add "$host_a"
ip netns add "$host_b"
ip link add sd0 netns "$host_a" type veth peer name sd0 netns "$host_b"
for host in a b; do
  name=host_$host address=address_$host
  ip -n "${!name}" address add "${!address}/24" dev sd0
  ip -n "${!name}" link set lo up
  ip -n "${!name}" link set sd0 up
done

export ROS_MASTER_URI=http://$address_a:11311
on_a() { ROS_IP=$address_a ip netns exec "$host_a" "$@"; }
on_b() { ROS_IP=$address_b ip netns exec "$host_b" "$@"; }
# Starts a job on host a, in its own process group.
start_on_a() {
  local log=$1
  shift
  set -m
  on_a "$@" >"$build/log/$log.log" 2>&1 </dev/null &
  set +m
  jobs_started=("$!" "${jobs_started[@]}")
}

start_on_a two-hosts-master roscore -p 11311
for ((i = 0; i < 300; i++)); do
  ! on_b rosparam list >/dev/null 2>&1 || break
  sleep 0.1
done
say "The other host can reach the master"

# Processor time of all nodes on host a, in ticks, and their number.
node_ticks() {
  local pid
  for pid in $(ip netns pids "$host_a"); do
    [[ $(cat "/proc/$pid/comm" 2>/dev/null) == stepdriver_node ]] || continue
    sed 's/.*) //' "/proc/$pid/stat" | cut -d' ' -f12,13
  done | awk '{ ticks += $1 + $2; nodes++ } END { print ticks + 0, nodes + 0 }'
}

topics=()
for ((i = 0; i < nodes; i++)); do
  on_a rosparam load "$configuration" "/n$i/stepdriver"
  topics+=("/n$i/joint_states")
done
heard=$build/log/two-hosts-heard.log
set -m
on_b "$catkin/devel/lib/stepdriver/node_listener" "$seconds" "${topics[@]}" >"$heard" 2>&1 </dev/null &
listener=$!
set +m
jobs_started=("$listener" "${jobs_started[@]}")
for ((i = 0; i < 300; i++)); do
  ! grep -q listening "$heard" || break
  sleep 0.1
done
begin=$(date +%s%N)
for ((i = 0; i < nodes; i++)); do
  start_on_a "two-hosts-$i" "$node" "__ns:=/n$i" __name:=stepdriver
done
sleep 3
read -r ticks running <<<"$(node_ticks)"
((running == nodes)) || die "only $running of $nodes nodes are running; their output is in $build/log/two-hosts-*.log"
sleep "$seconds"
read -r more running <<<"$(node_ticks)"
wait "$listener" || die "the other host doesn't hear all nodes: $(tail -n "$nodes" "$heard")"
while read -r topic first rate; do
  say "The other host hears $topic after $(((first - begin) / 1000000)) ms, at $rate Hz"
done < <(grep '^/' "$heard")
say "$running nodes on one host, at rest, use on average: $(awk -v ticks="$((more - ticks))" \
  -v per_second="$(getconf CLK_TCK)" -v nodes="$nodes" -v seconds="$seconds" \
  'BEGIN { printf "%.2f", 100 * ticks / per_second / seconds / nodes }') % of a core each"

on_b rosparam load "$configuration" /stepdriver
on_b "$catkin/devel/lib/stepdriver/node_bench" "$node" 6 "$build/bench/two_hosts.json" \
  >"$build/log/two-hosts-bench.log" 2>&1 || die "node_bench failed: see $build/log/two-hosts-bench.log"
say "A node on the other host, whose master is at the other end of the cable:"
sed 's/.*{"name": [^,]*, //; s/[]}]*$//; s/, /\n/g' "$build/bench/two_hosts.json" | indent
