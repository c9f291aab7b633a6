#!/usr/bin/env bash
# Builds cutforce and does its main job: the demo in closed loop, then the replay of a recording.
# Does its own set-up; ends by naming the reports it wrote.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=toolchain/steps.sh
source toolchain/steps.sh

recording=host_tests/recordings/entry_cut.csv.gz
program=build/release/firmware/host/cutforce

echo "cutforce: build, demo, replay"
start_log "$PWD/build/run.log"
step "set up" toolchain/setup.sh build
step "configure" cmake --preset host-release
step "build" cmake --build --preset host-release --target cutforce

shown_step "demo: a simulated lathe in closed loop" "$program" demo --out out/demo
shown_step "replay: force from a recording" "$program" replay "$recording" \
  --out out/replay/trace.csv --report

reports=()
for report in out/demo/report.html out/replay/report.html; do
  if [[ ! -s $report ]]; then
    echo "Failed: $report was not written. The full output is in $log"
    exit 1
  fi
  reports+=("$PWD/$report")
done
printf '\nOpen in a browser:\n'
printf '  %s\n' "${reports[@]}"
