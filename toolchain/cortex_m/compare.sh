#!/usr/bin/env bash
# compare.sh [--quick] [--table]: the same bits on every machine. The host program runs the loop over every
# recording with every estimator, every scenario, and one scenario with every controller; then each
# other build that is there replays the same samples, and every line has to be the same:
#   clang     build/clang       cmake --preset clang       && cmake --build --preset clang
#   aarch64   build/aarch64     likewise; under qemu-aarch64
#   m7        build/cortex-m    likewise; under QEMU's mps2-an500
#   m4        build/cortex-m4   mps2-an386
#   m33       build/cortex-m33  mps2-an505
# Exit status 0: no line differs; 1: one does; 77: a build or an emulator is missing, and what is
# there agrees. --quick: recordings and one scenario, for the test. --table: as the README shows it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

quick=0 table=0
for argument in "$@"; do
  case $argument in
    --quick) quick=1 ;;
    --table) table=1 ;;
    *) echo "usage: compare.sh [--quick] [--table]" >&2; exit 2 ;;
  esac
done
program=${CUTFORCE_PROGRAM:-build/release/firmware/host/cutforce}
if [[ ! -x $program ]]; then
  echo "$program is missing: cmake --preset host-release && cmake --build --preset host-release" >&2
  exit 2
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

recordings=(host_tests/recordings/*.csv.gz)
hash() { "$program" hash --streams "$work" "$@" >> "$work/host.txt"; }
for estimator in fused synthesized computed measured; do
  hash "${recordings[@]}" --estimator "$estimator"
done
if ((quick)); then
  hash host_tests/scenarios/demo_step.toml
else
  hash host_tests/scenarios/*.toml host_tests/scenarios/papers/*.toml
  for controller in none pi pid pole_assignment mrac variable_gain fuzzy predictive; do
    hash host_tests/scenarios/demo_step.toml --controller "$controller"
  done
fi
streams=("$work"/*.stream)
sort "$work/host.txt" > "$work/wanted.txt"
runs=$(wc -l < "$work/wanted.txt")

portable() { "$1" "${streams[@]}"; }
emulated_aarch64() { "$(command -v qemu-aarch64-static || command -v qemu-aarch64)" "$1" "${streams[@]}"; }
board() { toolchain/cortex_m/run.sh "$2" "$1" "${streams[@]}"; }

differing=0 missing=0
rows=()
# machine NAME WHAT FILE EMULATOR COMMAND...: FILE is the build; EMULATOR empty: it runs here.
machine() {
  local name=$1 what=$2 file=$3 emulator=$4
  shift 4
  if [[ ! -f $file ]] || { [[ -n $emulator ]] && ! command -v "$emulator" > /dev/null; }; then
    ((table)) || echo "$name: skipped, $([[ -f $file ]] && echo "$emulator" || echo "$file") is missing"
    missing=1
    return
  fi
  local began=$EPOCHREALTIME status=0
  "$1" "$file" "${@:2}" > "$work/$name.txt" 2> "$work/$name.err" || status=$?
  sed -n 's/\.stream outputs / outputs /p' "$work/$name.txt" | sort > "$work/$name.got"
  local same
  same=$(comm -12 "$work/wanted.txt" "$work/$name.got" | wc -l)
  rows+=("| $what | $same of $runs |")
  if ((!table)); then
    printf '%-8s %3d of %d runs the same, %s s\n' "$name" "$same" "$runs" \
      "$(awk -v a="$began" -v b="$EPOCHREALTIME" 'BEGIN { printf "%.1f", b - a }')"
  fi
  if ((same != runs || status != 0)); then
    differing=1
    echo "$name differs (exit status $status); wanted, then got:" >&2
    diff "$work/wanted.txt" "$work/$name.got" | head -n 20 >&2 || true
    tail -n 5 "$work/$name.err" >&2
  fi
}

machine clang "x86-64, clang++" build/clang/host_tests/hash_stream/cutforce_hash_stream "" portable
machine aarch64 "aarch64, g++, under qemu-user" \
  build/aarch64/host_tests/hash_stream/cutforce_hash_stream \
  "$(command -v qemu-aarch64-static > /dev/null && echo qemu-aarch64-static || echo qemu-aarch64)" \
  emulated_aarch64
image=firmware/cortex_m/cutforce_replay.elf
machine m7 "Cortex-M7, QEMU mps2-an500" build/cortex-m/$image qemu-system-arm board mps2-an500
machine m4 "Cortex-M4F, QEMU mps2-an386" build/cortex-m4/$image qemu-system-arm board mps2-an386
machine m33 "Cortex-M33, QEMU mps2-an505" build/cortex-m33/$image qemu-system-arm board mps2-an505

if ((table)); then
  printf '| machine | runs with the bits of x86-64, g++ |\n|---|---|\n'
  printf '%s\n' "${rows[@]}"
fi
((differing == 0)) || exit 1
((missing == 0)) || exit 77
