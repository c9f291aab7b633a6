#!/usr/bin/env bash
# Installs what is missing of toolchain/packages.txt: setup.sh [GROUP...]   (default: build test)
# Asks nothing; needs root, or a sudo that asks nothing, only when something is missing.
set -euo pipefail

list=$(dirname "${BASH_SOURCE[0]}")/packages.txt
(($#)) || set -- build test

wanted=()
for group in "$@"; do
  mapfile -t -O "${#wanted[@]}" wanted < <(awk -v group="$group" '$1 == group { print $2 }' "$list")
  awk -v group="$group" '$1 == group { found = 1 } END { exit !found }' "$list" || {
    echo "setup: no group '$group' in $list" >&2
    exit 2
  }
done

if ! command -v dpkg-query > /dev/null; then
  echo "setup: this is not Debian or Ubuntu. Install by hand what ${wanted[*]} provide, then set" >&2
  echo "setup: CUTFORCE_NO_SETUP=1 to leave this step out." >&2
  [[ -n ${CUTFORCE_NO_SETUP:-} ]] && exit 0
  exit 1
fi

# dpkg-query fails when it does not know a package at all; what it prints is right all the same.
installed=$(dpkg-query --show --showformat '${db:Status-Status} ${Package}\n' "${wanted[@]}" \
  2> /dev/null | sed -n 's/^installed //p' || true)
missing=()
for package in "${wanted[@]}"; do
  grep -qxF -- "$package" <<< "$installed" || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  echo "setup: nothing is missing"
  exit 0
fi
if [[ -n ${CUTFORCE_NO_SETUP:-} ]]; then
  echo "setup: left out, although these are missing: ${missing[*]}"
  exit 0
fi

as_root=()
if ((EUID != 0)); then
  as_root=(sudo --non-interactive)
  if ! "${as_root[@]}" true 2> /dev/null; then
    echo "setup: missing: ${missing[*]}" >&2
    echo "setup: run as root: apt-get install ${missing[*]}" >&2
    exit 1
  fi
fi
# The lock timeout: unattended upgrades hold the lock on a freshly started machine.
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300)
echo "setup: installing ${missing[*]}"
"${apt[@]}" update
"${apt[@]}" install --yes --no-install-recommends "${missing[@]}"
