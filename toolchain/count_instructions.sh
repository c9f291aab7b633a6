#!/usr/bin/env bash
# count_instructions.sh [NAME...]: x86-64 instructions of one call of each named benchmark body (all
# without a name), counted by callgrind. The same on every run; it changes with the code, the
# compiler and its flags, so both are printed. A body is run N and 2N times, and the difference
# divided by N, so that start-up and set-up cancel out; the loop's own instructions stay in
# (the body `empty` is nothing but them).
#   toolchain/count_instructions.sh                     # after toolchain/test.sh
#   CUTFORCE_COUNT_TIMES=10000 toolchain/count_instructions.sh space_vector_dot
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
program=${CUTFORCE_COUNT:-$root/build/release/host_tests/benchmarks/cutforce_count}
times=${CUTFORCE_COUNT_TIMES:-1000}
if [[ ! $times =~ ^[1-9][0-9]*$ ]]; then
  echo "CUTFORCE_COUNT_TIMES must be a positive whole number, not '$times'" >&2
  exit 2
fi
if ! command -v valgrind > /dev/null; then
  echo "valgrind is missing: toolchain/setup.sh build test" >&2
  exit 1
fi
if [[ ! -x $program ]]; then
  echo "$program is missing: cmake --preset host-release && cmake --build --preset host-release" >&2
  exit 1
fi

# instructions NAME TIMES. The number is padded, so that both runs get arguments of one length: the
# stack, and with it the C library's copying of it, starts alike.
instructions() {
  local output
  output=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" "$1" \
    "$(printf '%018d' "$2")" 2>&1) || {
    echo "$output" >&2
    return 1
  }
  sed -n 's/^==[0-9]*== Collected : \([0-9]*\).*/\1/p' <<< "$output"
}

mapfile -t names < <("$program" --list)
(($#)) || set -- "${names[@]}"
for name in "$@"; do
  [[ " ${names[*]} " == *" $name "* ]] || {
    echo "no body is named $name; there are: ${names[*]}" >&2
    exit 2
  }
done
compiler=$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' "$root/build/release/CMakeCache.txt")
echo "# $("${compiler:-c++}" --version | head -n 1), -O2; mean over calls $((times + 1)) to $((2 * times))"
printf '%-40s %s\n' '# body' 'instructions a call'
for name in "$@"; do
  once=$(instructions "$name" "$times")
  twice=$(instructions "$name" "$((2 * times))")
  awk -v name="$name" -v work="$((twice - once))" -v times="$times" \
    'BEGIN { printf "%-40s %.10g\n", name, work / times }'
done
