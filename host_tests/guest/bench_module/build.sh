#!/usr/bin/env bash
# build.sh: compiles the module against the fetched kernel headers, which need no kernel source.
# Result: build/board/bench_module/cutforce_bench.ko. Does nothing where that is newer than both.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."

board=$PWD/build/board
sources=host_tests/guest/bench_module
module=$board/bench_module/cutforce_bench.ko
headers=$(echo "$board"/headers/usr/src/linux-headers-*-rt-arm64)

if [[ -s $module && -z $(find "$sources" "$board/stamp" -newer "$module" -type f) ]]; then exit 0; fi
rm -rf "$board/bench_module"
mkdir "$board/bench_module"
cp "$sources"/*.[ch] "$sources/Kbuild" "$board/bench_module"

# As installed, this includes the common part by an absolute path.
echo "include $(echo "$board"/headers/usr/src/linux-headers-*-common-rt)/Makefile" \
  > "$headers/Makefile"
make --silent --directory "$headers" ARCH=arm64 CROSS_COMPILE=aarch64-linux-gnu- \
  CC=aarch64-linux-gnu-gcc-12 KCFLAGS=-Werror M="$board/bench_module" modules 2>&1 |
  { grep -v -e "^Skipping BTF" || true; }
aarch64-linux-gnu-strip --strip-debug "$module"
