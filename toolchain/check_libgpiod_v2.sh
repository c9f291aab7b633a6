#!/usr/bin/env bash
# check_libgpiod_v2.sh: compiles hal/linux/gpio_lines_v2.cpp and peer_lines_v2.cpp against the real
# header of libgpiod 2 and runs them over a stand-in for the library (host_tests/libgpiod_v2). Debian 12 has libgpiod 1
# only, so the header is unpacked from Debian 13's package, by an apt state of its own: this machine's
# packages stay as they are. Without that package it says so and ends with 77: skipped, not passed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$PWD/build/libgpiod_v2
suite=trixie
mkdir -p "$root"/{lists/partial,cache/archives/partial,sources.d,package}
: > "$root/status"

skip() {
  echo "SKIPPED: $1; libgpiod 2 is not checked" >&2
  exit 77
}

fetch() {
  local mirror
  # shellcheck disable=SC2016  # apt replaces $(REPO_URI)
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' |
    grep -m 1 '/debian/*$') || skip "this machine has no Debian mirror"
  cat > "$root/sources.d/$suite.sources" << EOF
Types: deb
URIs: $mirror
Suites: $suite
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg
EOF
  cat > "$root/apt.conf" << EOF
Dir::State "$root"; Dir::State::status "$root/status"; Dir::Cache "$root/cache";
Dir::Etc::sourcelist "/dev/null"; Dir::Etc::sourceparts "$root/sources.d";
Acquire::Languages "none";
EOF
  (
    export APT_CONFIG=$root/apt.conf
    apt-get update -qq && cd "$root" && apt-get download -qq libgpiod-dev
  ) > "$root/apt.log" 2>&1 || skip "Debian 13's libgpiod-dev cannot be fetched ($root/apt.log)"
  dpkg -x "$root"/libgpiod-dev_*.deb "$root/package"
}

[[ -e $root/package/usr/include/gpiod.h ]] || fetch

here=host_tests/libgpiod_v2
g++ -std=c++2b -O1 -g -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow \
  -Wold-style-cast -Wswitch-enum -Werror -fsanitize=address,undefined -fno-sanitize-recover=all \
  -I. -Ihost_tests -isystem "$root/package/usr/include" \
  hal/linux/gpio_lines_v2.cpp hal/linux/peer_lines_v2.cpp hal/linux/gpio_byte.cpp hal/linux/gpio_config.cpp \
  hal/linux/monotonic_clock.cpp "$here/stand_in.cpp" "$here/gpio_lines_v2_check.cpp" \
  "$here/peer_lines_v2_check.cpp" \
  -lgtest -lgtest_main -o "$root/check"
"$root/check" --gtest_brief=1
