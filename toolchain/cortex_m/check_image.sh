#!/usr/bin/env bash
# check_image.sh NM IMAGE: fails, with a line for each, where an image holds or needs what unwanted.txt
# names, where anything in it is still undefined, or where it has no symbols to look at.
set -euo pipefail
nm=$1 image=$2
list=$(dirname "${BASH_SOURCE[0]}")/unwanted.txt

symbols=$("$nm" "$image")
if [[ -z $symbols ]]; then
  echo "$image: $nm finds no symbol in it" >&2
  exit 1
fi
found=$(awk 'FNR == NR { if ($1 !~ /^#/) unwanted[$1] = 1; next }
             { name = $NF; sub(/^__wrap_/, "", name) }
             name in unwanted { print "  " name; next }
             NF == 2 && $1 == "U" { print "  " $2 ", undefined" }' "$list" <(echo "$symbols") | sort -u)
if [[ -n $found ]]; then
  echo "$(basename "$image") may not hold these:"
  echo "$found"
  exit 1
fi
