#!/usr/bin/env bash
# Builds cutforce and runs every test, in these builds:
#   host          every unit test under AddressSanitizer and UndefinedBehaviorSanitizer
#   host-release  the same tests at -O2 (the same bits must come out), what needs full speed, the
#                 gates on the core's archives, and the tests that read the tree
#   clang, cortex-m, cortex-m4, cortex-m33   what gives the same bits, or the release tests fail
#   aarch64       the core's tests on the board's processor (qemu-user), the service in an emulated
#                 board with the kernel's own drivers, and the disk image
# Does its own set-up. Where the packages of the last cannot be had, it is left out and counted as
# one skipped test. The last line is the count; exit status 0 iff nothing failed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=toolchain/steps.sh
source toolchain/steps.sh

passed=0 failed=0 skipped=0

# count NAME FILE: adds the totals of one JUnit file, as ctest writes them.
count() {
  local total bad dropped
  read -r total bad dropped < <(awk '
    /<testsuite / { inside = 1 }
    inside && match($0, /[ \t]tests="[0-9]+"/)    { total = substr($0, RSTART + 8) + 0 }
    inside && match($0, /[ \t]failures="[0-9]+"/) { bad = substr($0, RSTART + 11) + 0 }
    inside && match($0, /[ \t]disabled="[0-9]+"/) { dropped += substr($0, RSTART + 11) + 0 }
    inside && match($0, /[ \t]skipped="[0-9]+"/)  { dropped += substr($0, RSTART + 10) + 0 }
    inside && />/ { exit }
    END { print total + 0, bad + 0, dropped + 0 }' "$2")
  passed=$((passed + total - bad - dropped))
  failed=$((failed + bad))
  skipped=$((skipped + dropped))
  printf '%s passed, %s failed, %s skipped\n' "$((total - bad - dropped))" "$bad" "$dropped"
}

# skipped_tests FILE: name of each skipped test of a JUnit file, and why (as GTEST_SKIP says it).
skipped_tests() {
  awk '
    /<testcase / { match($0, / name="[^"]*"/); name = substr($0, RSTART + 7, RLENGTH - 8); why = "" }
    after { if ($0 != "") why = ": " $0; after = 0 }
    /: Skipped$/ { after = 1 }
    /<skipped/ { dropped = 1 }
    /<\/testcase>/ { if (dropped) print "      skipped: " name why; dropped = after = 0 }' "$1" |
    sed -e 's/&lt;/</g' -e 's/&gt;/>/g' -e 's/&quot;/"/g' -e "s/&apos;/'/g" -e 's/&amp;/\&/g'
}

# run_tests PRESET DIRECTORY: a failed test does not end the script; a ctest that ran none does.
run_tests() {
  local preset=$1 junit=$PWD/$2/tests.xml began=$EPOCHREALTIME status=0 results=$2/tests.log
  rm -f "$junit"
  printf '  %-46s' "test $preset"
  printf '\n== test %s\n' "$preset" >> "$log"
  ctest --preset "$preset" --parallel "$(nproc)" --no-tests=error --output-junit "$junit" \
    > "$results" 2>&1 < /dev/null || status=$?
  cat "$results" >> "$log"
  printf '%8s s   ' "$(elapsed_s "$began")"
  if [[ ! -s $junit ]]; then
    printf 'FAILED\n\n'
    tail -n 20 "$results"
    printf '\nFailed: ctest did not run. The full output is in %s\n' "$log"
    exit 1
  fi
  local failed_before=$failed
  count "$preset" "$junit"
  skipped_tests "$junit"
  if ((failed > failed_before || status != 0)); then
    sed -n '/The following tests FAILED/,$p' "$results" | grep -v -e '(Skipped)$' -e '^Errors while' || true
    grep -A 4 -e ': Failure$' -e 'ERROR: AddressSanitizer' -e 'runtime error:' "$results" |
      head -n 60 || true
    # What the tests in Python say: from the name to the exception.
    sed -n '/^\(FAIL\|ERROR\): /,/^[A-Za-z.]*\(Error\|Exception\)\>/p' "$results" | head -n 60 || true
    ((failed > failed_before)) || failed=$((failed + 1))  # ctest says no, and names no test
  fi
}

echo "cutforce: every test"
began=$EPOCHREALTIME
start_log "$PWD/build/test.log"
step "set up" toolchain/setup.sh build test
# build PRESET [OPTION...]
build() {
  step "configure $1" cmake --preset "$1"
  step "build $1" cmake --build --preset "$@"
}
build host
build host-release
# What the release tests compare bits with: the same loop by another compiler and on bare metal. What
# is not here is counted as skipped there.
if try "set up clang and bare metal" toolchain/setup.sh build cortex-m clang; then
  build clang --target cutforce_hash_stream
  for preset in cortex-m cortex-m4 cortex-m33; do build "$preset"; done
fi
board=no
if try "set up the board" toolchain/setup.sh build aarch64 guest image &&
  try "fetch the board's packages" toolchain/board/fetch.sh; then
  board=yes
  build aarch64
fi

run_tests host build/host
run_tests host-release build/release
if [[ $board == yes ]]; then
  run_tests aarch64 build/aarch64
else
  echo "      skipped: every test in the emulated board"
  skipped=$((skipped + 1))
fi

printf '\nFull output: %s, after %s s\n' "$log" "$(elapsed_s "$began")"
echo "$passed passed, $failed failed, $skipped skipped"
((failed == 0))
