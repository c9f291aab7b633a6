#!/usr/bin/env bash
# check_core_symbols.sh NM ARCHIVE [BESIDE...]
# What a core archive leaves to others must be in the archives BESIDE it or in the list below, and
# it must keep no global that changes. An allocation, a throw, a clock or a libm function is thus
# refused in whatever header it hides. Exit status 1 and one line for each symbol refused.
set -euo pipefail
nm=$1 archive=$2
shift 2

accepted=(
  sqrtf                       # correctly rounded on every target; where it is not one instruction
  memcpy memmove memset memcmp
  _GLOBAL_OFFSET_TABLE_       # x86-64: how position-independent code finds its data
  # 32-bit ARM: 64-bit arithmetic (time stamps are in nanoseconds)
  __aeabi_ldivmod __aeabi_uldivmod __aeabi_l2f __aeabi_ul2f __aeabi_f2lz __aeabi_f2ulz
)

table=$("$nm" --format=sysv "$archive")
if ! grep -q '^Symbols from ' <<< "$table"; then
  echo "$archive: $nm finds no object in it" >&2
  exit 1
fi
beside=$(for other in "$@"; do "$nm" --format=sysv "$other"; done)

refused=$(awk -F '|' -v accepted="${accepted[*]}" '
  BEGIN { n = split(accepted, names, " "); for (i = 1; i <= n; ++i) known[names[i]] = 1 }
  { gsub(/ /, "", $1); gsub(/ /, "", $3); gsub(/ /, "", $7) }
  FNR == 1 { ++file }
  file == 1 {  # own symbols
    if (match($0, /^Symbols from .*\[/)) {
      object = substr($0, RLENGTH + 1); sub(/\].*/, "", object)
    } else if ($3 == "U" || $3 == "w" || $3 == "v") {
      needs[$1] = needs[$1] " " object
    } else if (NF == 7) {
      known[$1] = 1
      if ($7 ~ /^(\.data|\.bss|\.tdata|\.tbss|\*COM\*)/ && $7 !~ /^\.data\.rel\.ro/)
        print $1 ": a global that changes, in " object
    }
    next
  }
  NF == 7 && $3 != "U" && $3 != "w" && $3 != "v" { known[$1] = 1 }
  END { for (name in needs) if (!(name in known)) print name ": needed by" needs[name] }
' <(echo "$table") <(echo "$beside") | sort)

if [[ -n $refused ]]; then
  echo "$(basename "$archive") may not rest on these:"
  while IFS= read -r line; do
    echo "  $line   ($(c++filt "${line%%:*}" 2> /dev/null || true))"
  done <<< "$refused"
  exit 1
fi
