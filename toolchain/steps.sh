# shellcheck shell=bash
# Sourced by run.sh and test.sh: one line a step on the terminal, everything else in a log file.

start_log() {
  log=$1
  mkdir -p "$(dirname "$log")"
  : > "$log"
}

elapsed_s() { awk -v from="$1" -v to="$EPOCHREALTIME" 'BEGIN { printf "%.1f", to - from }'; }

# step TITLE COMMAND...: output to the log; a failure shows its last lines and ends the script.
step() {
  local title=$1 began=$EPOCHREALTIME before
  shift
  before=$(wc -l < "$log")
  printf '  %-46s' "$title"
  printf '\n== %s\n$ %s\n' "$title" "$*" >> "$log"
  if "$@" >> "$log" 2>&1 < /dev/null; then
    printf '%8s s\n' "$(elapsed_s "$began")"
    return
  fi
  printf '%8s s   FAILED\n\n' "$(elapsed_s "$began")"
  tail -n "+$((before + 3))" "$log" | tail -n 40
  printf '\nFailed: %s. The full output is in %s\n' "$title" "$log"
  exit 1
}

# try TITLE COMMAND...: a step that may fail; what depends on it is then left out.
try() {
  local title=$1 began=$EPOCHREALTIME
  shift
  printf '  %-46s' "$title"
  printf '\n== %s\n$ %s\n' "$title" "$*" >> "$log"
  if "$@" >> "$log" 2>&1 < /dev/null; then
    printf '%8s s\n' "$(elapsed_s "$began")"
    return
  fi
  printf '%8s s   not here\n' "$(elapsed_s "$began")"
  tail -n 3 "$log" | sed 's/^/      /'
  return 1
}

# shown_step TITLE COMMAND...: for a program whose output is the point. Its standard error stays
# the terminal, so that it shows its progress there.
shown_step() {
  local title=$1 began=$EPOCHREALTIME status=0
  shift
  printf '\n$ %s\n' "$*"
  printf '\n== %s\n$ %s\n' "$title" "$*" >> "$log"
  "$@" < /dev/null | tee -a "$log" || status=$?
  if ((status != 0)); then
    printf '\nFailed: %s, with exit status %s. The full output is in %s\n' "$title" "$status" "$log"
    exit 1
  fi
  printf '\n  %-46s%8s s\n' "$title" "$(elapsed_s "$began")"
}
