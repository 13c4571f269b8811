#!/usr/bin/env bash
# Runs a command as root on its own kernel, which has simulated GPIO chips.
set -euo pipefail

usage() {
  cat <<'END_OF_USAGE'
usage: test/kernel/run.sh [OPTION...] [--] COMMAND [ARGUMENT...]
       test/kernel/run.sh --check

Boots the test kernel as an ordinary process (the first time, build_kernel.sh builds it), and runs the
command on it as root, with this machine's files, the caller's environment and working directory, no
standard input, and the caller's standard output and error.

  --chip NAME:LABEL:LINES[:OFFSET=LINE_NAME,...]
                  makes a GPIO chip first; may be given several times (see gpio_sim.sh)
  --trace FILE    writes to FILE what happened to the lines (see gpio_trace.sh, trace_to_vcd)
  --time-travel   virtual time: sleeping takes no real time, calculating takes no virtual time, and
                  every run has the same times. Each read of the clock takes 256 ns, and each event of
                  a trace reads it. Not for ROS: virtual time stops while a thread polls without
                  reading the clock
  --spi           with an SPI bus on the lines of another chip, "spi": the clock is its line 0, then the line
                  to the device, the line from it, and its chip select. It is /dev/spidev0.0
  --tmpfs FOLDER  hides FOLDER behind an empty one for the command; may be given several times
  --directory DIR working directory of the command (default: the caller's)
  --memory MB     memory of the machine (default: 512)
  --timeout S     ends the machine after that many seconds (default: 120)
  --check         takes no command: boots, and tells whether this machine can run the kernel. If not,
                  prints the reason and exits with 77

The command sees this machine's own files, and can write to them. /proc, /sys, /dev, /run, the processes
and the network (only the loopback, 127.0.0.1) are those of the test kernel. $GPIO_SIM is the path of
gpio_sim.sh: "$GPIO_SIM" pull LABEL OFFSET up|down presses an endstop. Processes that the command leaves
running end with it.

Exit status: the command's; 124 if it took too long; 125 if the machine couldn't be set up or died. After
124 and 125 there is a message that begins with "run.sh:".
END_OF_USAGE
}

fail() {
  local status=$1
  shift
  printf 'run.sh: %s\n' "$@" >&2
  exit "$status"
}
usage_error() {
  printf 'run.sh: %s\n' "$*" >&2
  usage >&2
  exit 2
}

# ---- options ----

chips=() tmpfs=() spi='' trace='' directory=$PWD memory=512 timeout=120 mode='' check=
while (($# > 0)); do
  case $1 in
    --chip | --trace | --tmpfs | --directory | --memory | --timeout)
      (($# > 1)) || usage_error "$1 needs a value"
      case $1 in
        --chip) chips+=("$2") ;;
        --trace) trace=$(realpath -m -- "$2") ;;
        --tmpfs) tmpfs+=("$2") ;;
        --directory) directory=$(realpath -- "$2") ;;
        --memory) memory=$2 ;;
        --timeout) timeout=$2 ;;
      esac
      shift 2
      ;;
    --spi) spi=1 && shift ;;
    --time-travel) mode=time-travel=inf-cpu && shift ;;
    --check) check=1 && shift ;;
    -h | --help) usage && exit ;;
    --) shift && break ;;
    -*) usage_error "unknown option: $1" ;;
    *) break ;;
  esac
done
[[ $memory =~ ^[0-9]+$ ]] || usage_error "--memory $memory isn't a number"
[[ $timeout =~ ^[0-9]+$ ]] || usage_error "--timeout $timeout isn't a number"
if [[ -n $check ]]; then
  (($# == 0)) || usage_error "--check takes no command"
  set -- true
else
  (($# > 0)) || usage_error "no command"
fi

# ---- the kernel and the first process ----

here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd -P)
[[ $(uname -m) == x86_64 ]] ||
  fail "$([[ -n $check ]] && echo 77 || echo 125)" \
    "User-Mode Linux needs an x86_64 machine; this is $(uname -m)"
kernel=$(bash "$here/build_kernel.sh") || fail 125 "there is no test kernel"

# Built once for each version of its source, and kept next to the kernels.
init=$(dirname "$(dirname "$kernel")")/init-$(sha256sum "$here/guest_init.cpp" | cut -c1-12)
if [[ ! -x $init ]]; then
  new_init=$(mktemp "$init.XXXXXX")
  /usr/bin/g++ -std=c++17 -O1 -pthread -o "$new_init" "$here/guest_init.cpp" ||
    fail 125 "guest_init.cpp couldn't be compiled"
  mv "$new_init" "$init"
fi

# ---- the folder that host and guest share ----

# Not under $TMPDIR. The path goes onto the kernel's command line, where blanks separate words; and a
# folder under /run, /dev or a --tmpfs would be hidden from the command.
work=$(mktemp -d /var/tmp/stepdriver-run.XXXXXX)
machine='' waiting=''
# shellcheck disable=SC2317
finish() {
  local status=$?
  trap '' INT TERM HUP
  if [[ -n $machine ]]; then
    kill -KILL -- "-$machine" 2>/dev/null || true
    wait "$machine" 2>/dev/null || true
  fi
  [[ -z $waiting ]] || kill "$waiting" 2>/dev/null || true
  rm -rf "$work"
  exit "$status"
}
trap finish EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

cp "$init" "$work/init"
cp "$here/gpio_sim.sh" "$here/gpio_trace.sh" "$work/"
chmod +x "$work/gpio_sim.sh"
device_tree=()
if [[ -n $spi ]]; then
  dtc -q -o "$work/spi.dtb" "$here/spi.dts" || fail 125 "spi.dts couldn't be compiled"
  device_tree=("dtb=$work/spi.dtb")
fi
printf '%s\0' "$@" >"$work/command"
printf '%s' "$directory" >"$work/directory"
GPIO_SIM=$work/gpio_sim.sh /usr/bin/env -0 >"$work/environment"
{
  echo 'set -eu; export PATH=/usr/bin:/bin:/usr/sbin:/sbin LC_ALL=C'
  for folder in "${tmpfs[@]}"; do printf 'mount -t tmpfs tmpfs %q\n' "$folder"; done
  for chip in "${chips[@]}"; do printf 'bash %s/gpio_sim.sh create %q\n' "$work" "$chip"; done
  # Virtual time begins at boot, and until the first ticks, timers are as coarse as ticks.
  [[ -z $mode ]] || echo 'sleep 0.1'
  # This kernel counts the time of a thread in ticks. In virtual time, each step of a regular motion can
  # coincide with a tick; the real-time throttle would then stop a thread that runs only for microseconds.
  [[ -z $mode ]] || echo 'echo -1 >/proc/sys/kernel/sched_rt_runtime_us'
  [[ -z $trace ]] || printf 'bash %s/gpio_trace.sh start\n' "$work"
} >"$work/before"
{
  echo 'set -eu; export PATH=/usr/bin:/bin:/usr/sbin:/sbin LC_ALL=C TMPDIR=/run'
  [[ -z $trace ]] || printf 'bash %s/gpio_trace.sh stop %s/trace\n' "$work" "$work"
} >"$work/after"

# The machine's memory is a file, in /dev/shm if there is enough room. In a container there often isn't.
memory_folder=/var/tmp
if [[ -w /dev/shm ]] && (($(df --output=avail -k /dev/shm | tail -n 1) > (memory + 64) * 1024)); then
  memory_folder=/dev/shm
fi

# ---- the run ----

# The output goes through `cat`, because the kernel changes the settings of the terminal that it writes to,
# which is the caller's.
exec {out}> >(exec cat)
copy_out=$!
exec {err}> >(exec cat >&2)
copy_err=$!

# The kernel is several processes, so it has its own process group. If this script is killed, the kernel's
# first process dies with it, and the others with the first.
set -m
TMPDIR=$memory_folder setpriv --pdeathsig KILL "$kernel" mem="${memory}M" $mode "${device_tree[@]}" \
  root=none rootfstype=hostfs rootflags=/ rw loglevel=4 console=tty0 umid=rig uml_dir="$work/uml/" \
  con=null ssl=null con0=null,fd:1 con1=null,fd:"$out" con2=null,fd:"$err" \
  init="$work/init" -- "$work" </dev/null >"$work/console" 2>&1 &
machine=$!
set +m
exec {out}>&- {err}>&-
sleep "$timeout" &
waiting=$!
ended=
wait -n -p ended "$machine" "$waiting" 2>/dev/null || true
kill -KILL -- "-$machine" 2>/dev/null || true
wait "$machine" 2>/dev/null || true
group=$machine machine=
wait "$copy_out" "$copy_err" || true

show_console() {
  echo "run.sh: the kernel's last messages:" >&2
  tail -n 30 "$work/console" | tr -d '\r' | awk '{ print "    " $0 }' >&2
}

verdict=
[[ ! -f $work/status ]] || read -r verdict <"$work/status"
case $verdict in
  'exit '*) ;;
  'error '*) fail 125 "${verdict#error }" ;;
  *)
    # The kernel checks the machine before anything else.
    if [[ -n $check ]] && ! grep -q 'PROT_EXEC mmap in .*OK' "$work/console"; then
      fail 77 "User-Mode Linux can't run on this machine: $(tail -n 2 "$work/console" | tr -s '\r\n' ' ')"
    fi
    show_console
    [[ $ended == "$group" ]] || fail 124 "the machine was ended after $timeout s, because the command was still running"
    fail 125 "the kernel died"
    ;;
esac
[[ -z $trace ]] || cat "$work/trace" >"$trace"
[[ -z $check ]] || echo "The test kernel runs here: $kernel"
exit "${verdict#exit }"
