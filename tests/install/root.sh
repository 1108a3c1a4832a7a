#!/usr/bin/env bash
# root.sh SUITE ARCHITECTURE PACKAGES IMAGE: makes IMAGE, a disc (ext4) with Debian SUITE ("bookworm",
# "trixie") for ARCHITECTURE ("amd64", "arm64"), systemd as its init and everything that the .deb files in
# the folder PACKAGES depend on, but none of them. The Debian is kept in $CHROOT_CACHE (default
# ~/.cache/dtactd-chroots); the image is made again only where something in it changed. For arm64 the
# kernel is Debian's, beside the image as vmlinuz and initrd.
#
# Exit code: 0 the image is there; 77 it cannot be made here (the reason is printed); else failed.
set -euo pipefail
suite=$1 architecture=$2 packages=$3 image=$4
here=$(cd "$(dirname "$0")" && pwd)
root=${CHROOT_CACHE:-$HOME/.cache/dtactd-chroots}/$suite-systemd
disc=/dev/ubda
[ "$architecture" = amd64 ] || { root+=-$architecture && disc=/dev/vda; }
# shellcheck source=tests/platform/chroot.sh
. "$here/../platform/chroot.sh"
# shellcheck source=tests/install/emulated.sh
. "$here/emulated.sh"

compgen -G "$packages/*.deb" > /dev/null || skip "no packages in $packages"
packages=$(cd "$packages" && pwd)

# Debian packages that the given packages depend on, without each other.
wanted() {
  local package field
  for package in "$packages"/*.deb; do
    for field in Pre-Depends Depends; do dpkg-deb -f "$package" "$field"; done
  done | tr ',' '\n' | sed 's/^ *//; s/ *$//' | grep . | sort -u | grep -vxE "($(ours))( .*)?" | paste -sd,
}
ours() {
  local package
  for package in "$packages"/*.deb; do dpkg-deb -f "$package" Package; done | paste -sd'|'
}
# In `COMMAND || …` bash would continue after a failure inside a function.
logged() {
  local status
  set +e
  (set -e; "$@") >> "$root.log" 2>&1
  status=$?
  set -e
  ((status == 0)) || { tail -n 20 "$root.log" >&2; exit 1; }
}

# Packages of the guest itself: an init, a bus for systemctl, device nodes and their groups, the tools of
# the tests. As in every installed Debian, nothing starts that the test does not start.
guest_packages=(systemd systemd-sysv dbus udev e2fsprogs kmod iproute2 procps)
depends=$(wanted)
if [ "$architecture" = amd64 ]; then
  prepare true "${guest_packages[@]}"
else
  prepare_emulated "$(IFS=,; echo "${guest_packages[*]}"),$depends"
fi
stamp=$({ cat "$root"/installed.* "$here"/{root,emulated}.sh "$here"/guest/*; echo "$depends"; } | sha256sum | cut -c1-16)
[ "$(cat "$image.stamp" 2> /dev/null)" = "$stamp" ] && [ -e "$image" ] && exit 0

echo "root.sh: making $image"
if [ "$architecture" = amd64 ]; then
  logged inside "apt-get update -qq
    apt-get satisfy -y -qq --no-install-recommends '$depends'
    apt-get clean
    rm -rf /var/lib/apt/lists/*"
else
  logged make_boot_files "$(dirname "$image")"
fi
cp "$here/guest/dtact-test.service" "$root/etc/systemd/system/"
cp "$here/guest/dtact-test" "$root/usr/local/sbin/"
mkdir -p "$root/job"
echo guest > "$root/etc/hostname"
printf '127.0.0.1 localhost guest\n::1 localhost\n' > "$root/etc/hosts"
echo "$disc / ext4 errors=remount-ro 0 1" > "$root/etc/fstab"
logged systemctl --root="$root" enable -q dtact-test.service
# Units that a guest of a minute does not need cost it half of its boot.
logged systemctl --root="$root" mask -q getty.target remote-fs.target timers.target \
  modprobe@{configfs,dm_mod,drm,efi_pstore,fuse,loop}.service systemd-modules-load.service \
  sys-kernel-{config,debug,tracing}.mount sys-fs-fuse-connections.mount \
  systemd-{sysctl,random-seed,update-utmp,update-utmp-runlevel,pstore,udev-trigger}.service
mkdir -p "$root"/etc/systemd/{journald,system}.conf.d
printf '[Journal]\nStorage=volatile\n' > "$root/etc/systemd/journald.conf.d/test.conf"
# A guest under load is slow, which is no fault of the service.
printf '[Manager]\nDefaultTimeoutStartSec=600s\n' > "$root/etc/systemd/system.conf.d/test.conf"
# So is the unit's. Time in which other programs had the host's processor counts as run time of the
# guest's real-time thread.
for unit in dtactd dtactd@; do
  mkdir -p "$root/etc/systemd/system/$unit.service.d"
  printf '[Service]\nTimeoutStartSec=600s\nLimitRTTIME=infinity\n' > "$root/etc/systemd/system/$unit.service.d/test.conf"
done
logged systemd-machine-id-setup --root="$root"
rm -f "$image.stamp" "$image.new"
logged mke2fs -q -t ext4 -d "$root" "$image.new" 2G
mv "$image.new" "$image"
echo "$stamp" > "$image.stamp"
