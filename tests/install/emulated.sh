# shellcheck shell=bash disable=SC2154
# Sourced by root.sh after chroot.sh, for a Debian of another architecture; the variables are root.sh's.
# Nothing of that Debian runs on this machine's kernel: its maintainer scripts
# run in the emulated machine of qemu.sh, on Debian's own kernel.

# foreign_apt TOOL ARGUMENT...: apt for that Debian without installed packages, in $root.apt.
foreign_apt() {
  local tool=$1
  shift
  "$tool" -qq -o APT::Architecture="$architecture" -o APT::Architectures="$architecture" \
    -o APT::Install-Recommends=false -o APT::Sandbox::User=root -o Acquire::Languages=none \
    -o Dir="$root.apt" -o Dir::State="$root.apt" -o Dir::State::status="$root.apt/status" \
    -o Dir::Cache="$root.apt" "$@"
}

# download WANTED: downloads packages that satisfy it, with all dependencies, into $root.apt/archives, and a kernel and
# busybox into $root.apt/boot.
download() {
  rm -rf "$root.apt"
  mkdir -p "$root.apt"/{lists,archives}/partial "$root.apt"/{etc/apt,boot}
  : > "$root.apt/status"
  echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian $suite main" \
    > "$root.apt/etc/apt/sources.list"
  foreign_apt apt-get update && foreign_apt apt-get -y --download-only satisfy "$1" || return 1
  local kernel
  kernel=$(foreign_apt apt-cache depends "linux-image-$architecture" | sed -n 's/^ *Depends: //p')
  (cd "$root.apt/boot" && foreign_apt apt-get download busybox-static "$kernel")
}

# make_boot_files FOLDER: the kernel as FOLDER/vmlinuz, and FOLDER/initrd, which loads the modules that a
# disc and a shared folder need and mounts the disc.
make_boot_files() {
  local folder=$1 tree=$root.apt/initrd linux=$root.apt/linux package version module
  rm -rf "$tree" "$linux"
  mkdir -p "$tree"/{bin,dev,modules,proc,root} "$linux/lib/modules"
  for package in "$root.apt"/boot/*.deb; do dpkg-deb -x "$package" "$linux"; done
  version=$(basename "$linux"/boot/vmlinuz-*)
  version=${version#vmlinuz-}
  # Debian 13 has the modules elsewhere and compressed.
  [ ! -d "$linux/usr/lib/modules" ] || cp -a "$linux/usr/lib/modules/." "$linux/lib/modules"
  depmod -b "$linux" "$version"
  for module in virtio_pci virtio_blk ext4 9p 9pnet_virtio; do
    modprobe -d "$linux" -S "$version" --show-depends "$module" || return 1
  done | awk '$1 == "insmod" && !seen[$2]++ { print $2 }' > "$linux/modules"
  while read -r module; do
    cp "$module" "$tree/modules"
    basename "${module%.xz}" >> "$tree/modules/order"
  done < "$linux/modules"
  ! compgen -G "$tree/modules/*.xz" > /dev/null || xz -d "$tree"/modules/*.xz
  cp "$(find "$linux" -name busybox -type f -perm -u=x)" "$tree/bin/busybox"
  install "$here/guest/initrd-init" "$tree/init"
  cp "$linux/boot/vmlinuz-$version" "$folder/vmlinuz"
  (cd "$tree" && find . | cpio --quiet -o -H newc | gzip -1) > "$folder/initrd"
  rm -r "$tree" "$linux"
}

# in_emulation DISC COMMANDS: runs a shell script as root of the Debian on the disc, with the folder
# $root.emulated as /job.
in_emulation() {
  rm -rf "$root.emulated/rc"
  echo "$2" > "$root.emulated/run"
  # It ends with this script, in every case.
  setpriv --pdeathsig TERM timeout 7200 "$here/qemu.sh" "$root.emulated" "$1" raw "$root.emulated" setup=1 \
    > "$root.emulated/console" < /dev/null || true
  [ "$(cat "$root.emulated/rc" 2> /dev/null)" = 0 ] || { tail -n 20 "$root.emulated"/{console,log}; return 1; }
}

# prepare_emulated WANTED: makes the Debian in $root, with packages that satisfy a list of dependencies.
# Kept until that list changes.
prepare_emulated() {
  local stamp tool
  [ "$(id -u)" = 0 ] || skip "a Debian in a folder needs root: sudo $0"
  [ "$(uname -m)" = x86_64 ] || skip "this machine is $(uname -m)"
  for tool in debootstrap:debootstrap qemu-system-aarch64:qemu-system-arm qemu-img:qemu-utils cpio:cpio depmod:kmod; do
    command -v "${tool%:*}" > /dev/null || skip "run: apt-get install ${tool#*:}"
  done
  mkdir -p "$(dirname "$root")"
  exec 9> "$root.lock"
  flock 9
  stamp=$(echo "$1" | sha256sum | cut -c1-16)
  [ "$(cat "$root/installed.emulated" 2> /dev/null)" != "$stamp" ] || return 0

  echo "root.sh: making a Debian $suite for $architecture in $root; its packages are set up in emulation"
  rm -rf "$root" "$root.emulated"
  mkdir -p "$root.emulated"
  : > "$root.log"
  { download "$1" && debootstrap --foreign --arch="$architecture" --variant=minbase "$suite" "$root"; } \
    >> "$root.log" 2>&1 || skip "no Debian $suite can be had: see $root.log"
  logged make_boot_files "$root.emulated"
  mkdir "$root/job"
  mv "$root.apt/archives" "$root/more"
  logged mke2fs -q -t ext4 -d "$root" "$root.emulated/disc" 4G
  # Few and large writes at the end, because each waits until this machine has done it.
  logged in_emulation "$root.emulated/disc" 'set -e
    /debootstrap/debootstrap --second-stage
    apt-get install -y --no-install-recommends /more/*.deb
    apt-get clean
    rm -rf /more /var/lib/apt/lists/*
    tar --blocking-factor 1000 --one-file-system -C / -cf /job/root.tar .'
  rm -rf "$root" "$root.emulated/disc"
  mkdir "$root"
  logged tar --numeric-owner -C "$root" -xpf "$root.emulated/root.tar"
  rm "$root.emulated/root.tar"
  echo "$stamp" > "$root/installed.emulated"
}
