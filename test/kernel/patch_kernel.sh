#!/usr/bin/env bash
# Makes the changes to the kernel's source, in the current folder, that the tests need.
set -euo pipefail

die() {
  printf 'patch_kernel.sh: %s\n' "$*" >&2
  exit 1
}

# Processors with AMX have a larger floating-point state than this constant has room for, and the
# first process dies of it. Newer kernels ask the processor instead.
file=arch/x86/um/user-offsets.c
if grep -q 'HOST_FP_SIZE, 2696' "$file"; then
  sed -i 's/HOST_FP_SIZE, 2696/HOST_FP_SIZE, 11008/' "$file"
elif ! grep -rqw host_fp_size arch/x86/um; then
  die "$file has another size for the floating-point state than is known here"
fi

# This kernel's clock has steps of 256 ns; the host's, which it reads, has steps of 1 ns.
file=arch/um/kernel/time.c
sed -i 's| */ *TIMER_MULTIPLIER||' "$file"
(($(grep -cE 'return (time_travel_time|os_nsecs\(\));|timer_clocksource, NSEC_PER_SEC\)' "$file") == 3)) ||
  die "$file has another clock than is known here"
