#!/usr/bin/env bash
# benchmark.sh [--quick]: measures everything side by side in one run and prints times, instructions
# and ratios against the obvious alternatives. Raw results stay in build/benchmark.
#
#   raw sample, ticks, whole loop   ns and x86-64 instructions (callgrind); not with --quick
#   replay                          rows/s from CSV text and binary, reader alone and with the loop
#   simulated machine               times real time
#   against                         numpy_reference.py on the same recording, getline and strtof
#
# Google Benchmark's own messages are in build/benchmark/log. Debian builds its library without
# NDEBUG and says so: that concerns the library's loop, one step in a thousand calls.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

quick=
if (($# == 1)) && [[ $1 == --quick ]]; then
  quick=1
elif (($#)); then
  echo "usage: toolchain/benchmark.sh [--quick]" >&2
  exit 2
fi

# shellcheck source=toolchain/steps.sh
source toolchain/steps.sh
here=$PWD/build/benchmark
mkdir -p "$here"
start_log "$here/log"
benchmarks=build/release/host_tests/benchmarks/cutforce_benchmarks
export CUTFORCE_BENCHMARK_FOLDER=$here

echo "cutforce: benchmarks"
step "set up" toolchain/setup.sh build test benchmark
step "configure" cmake --preset host-release
step "build" cmake --build --preset host-release --target cutforce_benchmarks cutforce_count
step "time" "$benchmarks" --benchmark_min_time=0.5 --benchmark_out="$here/benchmarks.json" \
  --benchmark_out_format=json
step "numpy" /usr/bin/python3 host_tests/benchmarks/numpy_reference.py "$here/r.csv" \
  "$here/numpy.json"
results=("$here/benchmarks.json" "$here/numpy.json")
if [[ -z $quick ]]; then
  count() { toolchain/count_instructions.sh > "$here/instructions.txt"; }
  step "count instructions" count
  results+=("$here/instructions.txt")
fi
echo
/usr/bin/python3 host_tests/benchmarks/summary.py "${results[@]}" | tee -a "$here/log"
rm -f "$here"/r.csv "$here"/r.csv.gz "$here"/r.cfr "$here"/w.* "$here"/t.csv*
