#!/usr/bin/env bash
# fetch.sh [--update]: downloads the packages of toolchain/board/packages.txt for arm64 and unpacks
# each folder of that table below build/board. Needs no root and leaves this machine's packages as
# they are: apt works in a state of its own. A second run downloads nothing, unless the table or
# this script changed, or --update asks for newer versions. Ends by printing what it got:
#   build/board/versions.txt   folder, package, version, architecture
#   build/board/release        the kernel's release, for paths below build/board/kernel
#
# The mirror is the one this machine uses: its apt sources for the suites below. On a machine of
# another suite, CUTFORCE_APT_SOURCES names a .sources file (man 5 sources.list) with them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

suites=(bookworm bookworm-security)
table=toolchain/board/packages.txt
board=$PWD/build/board
here_architecture=$(dpkg --print-architecture)  # of the programs that compile modules

if (($# > 1)) || { (($# == 1)) && [[ $1 != --update ]]; }; then
  echo "usage: toolchain/board/fetch.sh [--update]" >&2
  exit 2
fi

mkdir -p "$board"
exec 9> "$board/.lock"
flock 9  # two tests may ask for it at once

wanted=$(cat "$table" toolchain/board/fetch.sh | sha256sum)
if (($# == 0)) && [[ $(cat "$board/stamp" 2> /dev/null) == "$wanted" ]]; then
  cat "$board/versions.txt"
  exit 0
fi
rm -f "$board/stamp"

# One deb822 stanza for each of this machine's sources that has one of the suites. Its
# architectures are left out: they are this machine's.
apt_sources() {
  local list parts
  eval "$(apt-config shell list Dir::Etc::sourcelist/f parts Dir::Etc::sourceparts/d)"
  local files=()
  if [[ -n ${CUTFORCE_APT_SOURCES:-} ]]; then
    files=("$CUTFORCE_APT_SOURCES")
  else
    [[ -e $list ]] && files+=("$list")
    mapfile -t -O "${#files[@]}" files < <(
      find "${parts:-/nonexistent}" -maxdepth 1 \( -name '*.list' -o -name '*.sources' \) | sort)
  fi
  awk -v suites="${suites[*]}" '
    BEGIN { n = split(suites, names, " "); for (i = 1; i <= n; ++i) known[names[i]] = 1 }
    function stanza(  i, n, parts, kept) {
      n = split(suite, parts, /[ \t]+/)
      for (i = 1; i <= n; ++i) if (parts[i] in known) kept = kept " " parts[i]
      if (type ~ /(^|[ \t])deb([ \t]|$)/ && kept != "" && !off)
        printf "Types: deb\nURIs: %s\nSuites:%s\nComponents: main\n%s\n", uri, kept,
               signed == "" ? "" : "Signed-By:" signed "\n"
      type = uri = suite = signed = field = ""; off = 0
    }
    FNR == 1 { stanza() }
    FILENAME ~ /\.sources$/ && /^[ \t]*$/ { stanza(); next }
    /^[ \t]*#/ { next }
    FILENAME ~ /\.sources$/ {
      value = $0
      if (value !~ /^[ \t]/) { field = tolower(value); sub(/:.*/, "", field); sub(/^[^:]*:[ \t]*/, "", value) }
      if (field == "types") type = type value
      if (field == "uris") uri = uri value
      if (field == "suites") suite = suite " " value
      if (field == "signed-by") signed = signed (signed == "" ? " " : "\n") value
      if (field == "enabled" && tolower(value) ~ /^(no|false|0)/) off = 1
      next
    }
    $1 == "deb" {  # deb [options] address suite component...
      line = $0; options = ""
      if (match(line, /\[[^]]*\]/)) {
        options = substr(line, RSTART + 1, RLENGTH - 2)
        line = substr(line, 1, RSTART - 1) substr(line, RSTART + RLENGTH)
      }
      split(line, word, /[ \t]+/)
      type = "deb"; uri = word[2]; suite = word[3]
      if (match(options, /signed-by=[^ \t]*/)) signed = " " substr(options, RSTART + 10, RLENGTH - 10)
      stanza()
    }
    END { stanza() }' "${files[@]}"
}

apt_root=$board/apt
mkdir -p "$apt_root"/{state/lists/partial,cache,sources.d}
: >> "$apt_root/status"
apt_sources > "$apt_root/sources.d/board.sources"
for suite in "${suites[@]}"; do
  grep -q "^Suites:.* $suite\( \|$\)" "$apt_root/sources.d/board.sources" && continue
  echo "fetch: this machine's apt sources have no suite $suite; name a .sources file that does" >&2
  echo "fetch: in CUTFORCE_APT_SOURCES" >&2
  exit 1
done
# Read after this machine's own settings (its proxy stays); hooks that tidy up after its own
# downloads are not for us.
cat > "$apt_root/apt.conf" << END
#clear APT::Architectures;
#clear APT::Update;
#clear DPkg;
#clear Dir::Etc::preferencesparts;
APT::Architecture "arm64";
APT::Architectures { "arm64"; "$here_architecture"; };
APT::Install-Recommends "false";
APT::Sandbox::User "";
Acquire::Languages "none";
Dir::State "$apt_root/state";
Dir::State::status "$apt_root/status";
Dir::Cache "$apt_root/cache";
Dir::Etc::sourcelist "/dev/null";
Dir::Etc::sourceparts "$apt_root/sources.d";
Dir::Etc::preferencesparts "/dev/null";
END
apt() { "apt-$1" --config-file "$apt_root/apt.conf" "${@:2}"; }
depends_of() { apt cache depends --no-recommends --no-suggests "$1" | sed -n 's/^  Depends: //p'; }

apt get --quiet=2 update

declare -A alone closure
while read -r folder package how _; do
  case $how in
    alone) alone[$folder]+=" $package" ;;
    closure) closure[$folder]+=" $package" ;;
    metapackage)
      package=$(depends_of "$package" | grep -- '-rt-arm64' | head -n 1)
      alone[$folder]+=" $package"
      if [[ $folder == kernel ]]; then
        release=${package#linux-image-}
      else  # headers: the part shared by all flavours, and kbuild as it runs here
        alone[$folder]+=" $(depends_of "$package" | grep -- '-common-rt' | sed 's/:.*//')"
        alone[$folder]+=" $(depends_of "$package" | grep '^linux-kbuild' | sed 's/:.*//')"
        alone[$folder]=${alone[$folder]/linux-kbuild*/&:$here_architecture}
      fi ;;
    *) echo "fetch: $table: '$how' is no way to fetch $package" >&2; exit 1 ;;
  esac
done < <(grep -v -e '^#' -e '^$' "$table")

# The archives stay in debs/: what is there with the right checksum is not downloaded again.
versions=
for folder in "${!alone[@]}" "${!closure[@]}"; do
  debs=$board/debs/$folder
  mkdir -p "$debs/partial"
  # Listed where no archive is yet: apt leaves out what it has.
  if [[ -n ${alone[$folder]:-} ]]; then
    read -ra packages <<< "${alone[$folder]}"
    uris=$(cd "$apt_root" && apt get download --print-uris "${packages[@]}")
    (cd "$debs" && apt get --quiet=2 download "${packages[@]}")
  else
    read -ra packages <<< "${closure[$folder]}"
    uris=$(apt get --quiet=2 install --print-uris --yes "${packages[@]}")
    apt get --quiet=2 --option "Dir::Cache::archives=$debs" install --yes --download-only \
      "${packages[@]}"
  fi
  mapfile -t names < <(awk '/^\x27/ { print $2 }' <<< "$uris")
  ((${#names[@]})) || { echo "fetch: apt names no archive for $folder" >&2; exit 1; }
  rm -rf "${board:?}/$folder" && mkdir "$board/$folder"
  for name in "${names[@]}"; do
    dpkg-deb --extract "$debs/$name" "$board/$folder"
    versions+=$(dpkg-deb --show --showformat="$folder \${Package} \${Version} \${Architecture}" \
      "$debs/$name")$'\n'
  done
  # Archives of versions before this one.
  for deb in "$debs"/*.deb; do
    [[ " ${names[*]} " == *" ${deb##*/} "* ]] || rm "$deb"
  done
done

echo "$release" > "$board/release"
/sbin/depmod --basedir "$board/kernel" "$release"
sort <<< "${versions%$'\n'}" | column -t > "$board/versions.txt"
echo "$wanted" > "$board/stamp"
cat "$board/versions.txt"
