#!/usr/bin/env bash
# Makes the recordings in host_tests/recordings/ anew from their scenarios in host_tests/scenarios/,
# bit for bit the same on every machine. A difference is a change of the simulated machine, which
# the commit has to explain.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

program=${CUTFORCE_PROGRAM:-build/release/firmware/host/cutforce}
if [[ ! -x $program ]]; then
  echo "$program is missing: toolchain/run.sh builds it" >&2
  exit 1
fi
for name in entry_cut air_cut two_currents_line_to_line vhz; do
  "$program" simulate "host_tests/scenarios/$name.toml" \
    --recording "host_tests/recordings/$name.csv.gz"
done
ls -l host_tests/recordings
