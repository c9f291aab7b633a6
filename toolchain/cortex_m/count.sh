#!/usr/bin/env bash
# count.sh [PRESET]: what the bare-metal image costs, as "name number" lines: flash, RAM, stack, and the
# instructions of every block, mean and most of any call. The same on every run; it changes with the
# code, the compiler and its flags. PRESET: cortex-m (the default), cortex-m4, cortex-m33.
#   toolchain/cortex_m/count.sh > host_tests/cortex_m/budget.txt     # a new budget; the commit says why
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

preset=${1:-cortex-m}
case $preset in
  cortex-m) machine=mps2-an500 ;;
  cortex-m4) machine=mps2-an386 ;;
  cortex-m33) machine=mps2-an505 ;;
  *) echo "no preset is named $preset; there are: cortex-m cortex-m4 cortex-m33" >&2; exit 2 ;;
esac
images=build/$preset/firmware/cortex_m
program=${CUTFORCE_PROGRAM:-build/release/firmware/host/cutforce}
for file in "$program" "$images/cutforce_image.elf" "$images/cutforce_meter.elf"; do
  [[ -f $file ]] || { echo "$file is missing" >&2; exit 127; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

echo "# $(arm-none-eabi-g++ --version | head -n 1), -O2 and -Os by source, $preset, $machine: name and number"
echo "# bytes"
toolchain/cortex_m/size.py "$images/cutforce_image.elf" --brief
toolchain/cortex_m/stack.py "build/$preset" "$images/cutforce_image.elf" |
  awk '$1 == "worst" { print "stack_worst", $2 }
       $1 ~ /run_board$/ { print "stack_cycle", $2 }
       $1 ~ /ControlLoop::step$/ { print "stack_loop_step", $2 }'
echo "# instructions a call: mean, and most"
"$program" hash host_tests/scenarios/demo_step.toml --streams "$work" > /dev/null
toolchain/cortex_m/run.sh "$machine" "$images/cutforce_meter.elf" "$work/demo_step.stream" |
  awk '{ print $1, $2; if ($3 != $2) print $1 "_most", $3 }'
