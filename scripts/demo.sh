#!/usr/bin/env bash
# Brings up an axis on the simulated rig, moves it and shows what its pins did.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/demo.sh [--installed | --packaged]

Installs missing packages, builds the package into build/install, launches one axis on the simulated
rig, enables it, moves it 1000 steps forward and back with rosservice call, and shows the commands, the
activity of the pins and the position of the axis. Writes the pin trace to a file. Exit code 0: all of
these agree.

  --installed  builds nothing: uses build/install as it is
  --packaged   builds and installs nothing: uses the Debian package ros-stepdriver
END
}

installed=
case ${1:-} in
  '') ;;
  --installed | --packaged) installed=${1#--} ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

# From config/a4988.yaml: 80 steps/mm.
distance=0.0125
steps=1000

problems=0
problem() {
  say "  WRONG: $*"
  problems=$((problems + 1))
}

# The value of a field in the output of rosservice or rostopic. A list has only one axis here.
field() { sed -n "s/^$2: *//p" <<<"$1" | head -n 1 | tr -d '[]'; }

same_place() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a != "" && (a - b) ^ 2 < 1e-6 ^ 2) }'; }

# Runs a ROS command, with a time limit, and stores its output in $answer.
ask() {
  answer=$(timeout --foreground 60 "$@" </dev/null 2>&1) || die "$* failed: $answer"
}

# Shows a service call as a person would type it, and its answer.
call() {
  say "\$ rosservice call $1 \"$2\""
  ask rosservice call "$1" "$2"
  indent <<<"$answer"
  [[ $(field "$answer" success) == True ]] || problem "refused"
}

# Moves by a distance [m] and checks that service, pins and joint_states agree.
move() {
  local by=$1 goal=$2 goal_forward=$3 goal_backward=$4 forward backward violations place
  say "" "Commanded: move by $by m, which is $steps steps, to $goal m"
  call /stepdriver/x/move_to "{position: $by, relative: true, velocity: 0.0, wait: true}"
  same_place "$(field "$answer" position)" "$goal" || problem "that isn't $goal m"

  ask rosservice call /stepdriver/rig/report
  forward=$(field "$answer" pulses_forward)
  backward=$(field "$answer" pulses_backward)
  violations=$(field "$answer" violations)
  say "The pins:  $forward pulses forward and $backward backward so far, $violations violations" \
    "           of the chip's timings (rosservice call /stepdriver/rig/report)"
  [[ $forward == "$goal_forward" && $backward == "$goal_backward" ]] ||
    problem "not $goal_forward forward and $goal_backward backward"
  [[ $violations == 0 ]] || problem "$answer"

  ask rostopic echo -n 1 /joint_states
  place=$(field "$answer" position)
  say "The axis:  at $place m (rostopic echo /joint_states)"
  same_place "$place" "$goal" || problem "that isn't $goal m"
}

# Only what is installed, compiled as fast as possible: many files as one, and -O1, which takes two thirds
# of the time of -O2.
build_demo() {
  configure "$src" "$build/demo/catkin" -DPYTHON_EXECUTABLE=/usr/bin/python3 \
    -DCMAKE_INSTALL_PREFIX="$build/install" "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -DNDEBUG$roomy" \
    -DCATKIN_ENABLE_TESTING=OFF -DCMAKE_UNITY_BUILD_BATCH_SIZE=40 &&
    cmake --build "$build/demo/catkin" -j "$jobs"
}

choose_build_folder
[[ $installed == packaged ]] || install_packages core ros panel trace
if [[ -z $installed ]]; then
  rm -rf "$ROS_HOME/log"
  say "Building: the first time this takes two to three minutes of processor time" \
    "    (in another terminal: tail -f $build/log/build.log)"
  quietly build build_demo
  quietly install cmake --install "$build/demo/catkin"
fi
if [[ $installed == packaged ]]; then choose_master; else use_ros "$build/install"; fi

trace=$build/demo/axis.vcd
log=$build/demo/roslaunch.log
mkdir -p "$build/demo"
rm -f "$trace"

say "\$ roslaunch stepdriver axis.launch sim:=true trace:=$trace"
set -m
roslaunch -p "$ros_port" stepdriver axis.launch sim:=true "trace:=$trace" \
  >"$log" 2>&1 </dev/null &
launch=$!
set +m
end_launch() {
  [[ -z $launch ]] || end_group "$launch" 30
  launch=
}
at_exit end_launch
for ((i = 0; ; i++)); do
  rosservice list </dev/null 2>/dev/null | grep -qxF /stepdriver/x/move_to && break
  if ! kill -0 "$launch" 2>/dev/null || ((i == 60)); then
    tail -n 40 "$log" >&2
    die "the axis didn't come up (roslaunch's output is above)"
  fi
  sleep 0.5
done

say "" "Enabling the motor:"
call /stepdriver/x/enable "data: true"
move "$distance" "$distance" "$steps" 0
move "-$distance" 0 "$steps" "$steps"

# The node closes the trace when it ends.
end_launch
if grep -E 'process has died|escalating to SIGTERM' "$log" >&2; then
  problem "the node didn't end well (see $log)"
fi

say "" "The pin trace: $trace"
# compress shortens pauses of more than 1000 ns; otherwise sigrok reads each nanosecond of them.
look=(sigrok-cli -i "$trace" -I vcd:compress=1000 -P stepper_motor:step=step:dir=dir
  -A stepper_motor=position)
if [[ ! -s $trace ]]; then
  problem "there is no trace"
else
  # The decoder prints a position only when the next step comes. The largest one is where the axis turned.
  decoded=$("${look[@]}" </dev/null 2>"$build/log/sigrok.log" |
    sed -n 's/^stepper_motor-1: \(-\?[0-9]*\) steps$/\1/p') || true
  far=$(sort -n <<<"$decoded" | tail -n 1)
  say "The stepper_motor decoder of sigrok-cli, an independent program, reads: out to ${far:-no} steps"
  [[ $far == "$steps" ]] || problem "that isn't $steps steps"
  say "Look at it:" \
    "    gtkwave $trace" \
    "    pulseview -I vcd:downsample=100 -i $trace" \
    "    ${look[*]}"
fi

((problems == 0)) || die "$problems thing(s) above went wrong"
say "" "All of these agree."
if [[ $installed != packaged ]]; then
  say "To continue by hand, first run in each terminal:" "    source $build/install/setup.bash"
fi
