#!/usr/bin/env bash
# run.sh MACHINE ELF [ARGUMENT...]: an image under QEMU (mps2-an500, mps2-an386 or mps2-an505), its
# output on standard output, its exit status as the status. The arguments reach the image by
# semihosting. Every instruction takes exactly 1024 ns of the board's time, so that a run is the same
# each time and instructions can be counted by a timer.
#   CUTFORCE_QEMU_OPTIONS     more options, such as -serial file:uart.txt
#   CUTFORCE_QEMU_TIMEOUT_S   120; exit status 124 where it is not over by then
#   CUTFORCE_ICOUNT_SHIFT     10; 3 makes it 8 ns an instruction, near a processor of 125 MHz
set -euo pipefail
if (($# < 2)); then
  echo "usage: run.sh MACHINE ELF [ARGUMENT...]" >&2
  exit 2
fi
machine=$1 image=$2
shift 2

if ! command -v qemu-system-arm > /dev/null; then
  echo "qemu-system-arm is missing: toolchain/setup.sh cortex-m" >&2
  exit 127
fi
if [[ ! -f $image ]]; then
  echo "$image is missing: cmake --preset cortex-m && cmake --build --preset cortex-m" >&2
  exit 127
fi

semihosting=enable=on,target=native,chardev=semihosting,arg=image
for argument in "$@"; do semihosting+=,arg=${argument//,/,,}; done
read -ra more <<< "${CUTFORCE_QEMU_OPTIONS:-}"
# The board's network card warns that it has no peer; it shall have none.
exec timeout "${CUTFORCE_QEMU_TIMEOUT_S:-120}" qemu-system-arm -M "$machine" -nodefaults -nic none \
  -display none -monitor none -icount "shift=${CUTFORCE_ICOUNT_SHIFT:-10},sleep=off" \
  -chardev stdio,id=semihosting,signal=off -semihosting-config "$semihosting" \
  "${more[@]}" -kernel "$image" < /dev/null 2> >(grep -v 'nic lan9118.0 has no peer' >&2)
