#!/usr/bin/env bash
# image.sh [--placeholder]: builds the board's disk image, build/board/image/cutforce.img: kernel,
# initial file system and service in one file that UEFI starts, and a data partition. Needs no root.
# The same sources and packages give the same bytes. What to do with it: toolchain/board/IMAGE.md.
#   --placeholder   something harmless in place of the service, to try the image alone
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

service=build/aarch64/firmware/linux/cutforced
if (($# == 1)) && [[ $1 == --placeholder ]]; then
  service=toolchain/board/image/bin/placeholder
elif (($#)); then
  echo "usage: toolchain/board/image.sh [--placeholder]" >&2
  exit 2
elif [[ ! -x $service ]]; then
  echo "image: no $service; build it: cmake --preset aarch64 && cmake --build --preset aarch64" >&2
  exit 1
fi

toolchain/board/fetch.sh > /dev/null
folder=build/board/image
rm -rf "$folder"
# An empty data partition: mke2fs would copy the change times of files, which nobody can set.
mkdir -p "$folder/root/data"
/usr/bin/python3 toolchain/board/image.py "$service" "$folder"

# One time and one identifier for everything that would take today's, or a random one.
time=315532800  # 1980: FAT has no earlier
export SOURCE_DATE_EPOCH=$time E2FSPROGS_FAKE_TIME=$time E2FSCK_TIME=$time TZ=UTC
id() { echo "c07f0fce-0000-4000-8000-0000000000$1"; }
find "$folder/esp" "$folder/root" -exec touch --no-dereference --date="@$time" {} +
cat > "$folder/genimage.cfg" << END
image esp.vfat {
  vfat {
    label = "CUTFORCE"
    extraargs = "--invariant -i c07f0fce"
    files = { "EFI" }
  }
  size = 96M
}
image data.ext4 {
  ext4 {
    label = "cutforce-data"
    use-mke2fs = true
    extraargs = "-U $(id 02) -E hash_seed=$(id 03),root_owner=0:0,lazy_itable_init=0"
  }
  mountpoint = "/data"
  size = 64M
}
image cutforce.img {
  hdimage {
    partition-table-type = "gpt"
    disk-uuid = "$(id 10)"
  }
  partition esp {
    image = "esp.vfat"
    partition-type-uuid = "U"
    partition-uuid = "$(id 11)"
  }
  partition cutforce-data {
    image = "data.ext4"
    partition-type-uuid = "L"
    partition-uuid = "$(id 12)"
  }
}
END
if ! genimage --config "$folder/genimage.cfg" --rootpath "$folder/root" --tmppath "$folder/tmp" \
  --inputpath "$folder/esp" --outputpath "$folder/out" > "$folder/genimage.log" 2>&1; then
  cat "$folder/genimage.log" >&2
  exit 1
fi
mv "$folder/out/cutforce.img" "$folder/cutforce.img"
rm -r "$folder"/{root,tmp,out,esp}
echo "disk image: $PWD/$folder/cutforce.img"
du --bytes "$folder/cutforce.img" | awk '{ print "disk image: " $1 " bytes" }'
sha256sum "$folder/cutforce.img"
