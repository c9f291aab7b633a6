#!/usr/bin/env bash
# Writes host_tests/golden/ anew with the release build: after a change of the loop that is meant to
# change its numbers. The commit has to explain the difference.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build=${CUTFORCE_BUILD:-build/release}
[[ -d $build ]] || cmake --preset host-release
cmake --build "$build" --target cutforce_tests
rm -f host_tests/golden/*
CUTFORCE_WRITE_GOLDEN=1 "$build/host_tests/cutforce_tests" --gtest_filter='Golden.*' --gtest_brief=1
du -sh host_tests/golden
git diff --stat -- host_tests/golden
