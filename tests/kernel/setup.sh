#!/bin/bash
# setup.sh: makes the guest kernel of the kernel tests, once, in a cache folder.
#
# The kernel is User Mode Linux (a Linux kernel that runs as an ordinary program) built from
# Debian's linux-source-6.1 with uml.config, and the modules of modules/ beside it: about 4 minutes
# on 2 cores. It is made again when this, uml.config or a module changes. Nothing is installed but build
# tools, and those only by root.
#
# Exit code: 0 the kernel is there; 77 it cannot be had on this machine (the reason is printed).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cache=${KERNEL_CACHE:-$HOME/.cache/dtactd-kernel}
source_package=linux-source-6.1
packages=(build-essential bc bison flex libelf-dev kmod busybox-static xz-utils iproute2)

skip() {
  echo "kernel tests: no guest kernel: $*" >&2
  exit 77
}

stamp=$(cat "$here/setup.sh" "$here/uml.config" "$here"/modules/* | sha256sum | cut -c1-16)
is_ready() { [ -x "$cache/linux" ] && [ "$(cat "$cache/stamp" 2> /dev/null)" = "$stamp" ]; }

mkdir -p "$cache"
exec 9> "$cache/lock"
flock 9 # two test runs at once make one kernel
if is_ready; then
  echo "guest kernel: $cache"
  exit 0
fi

[ "$(uname -m)" = x86_64 ] || skip "User Mode Linux runs on x86-64, this is $(uname -m)"
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2> /dev/null | grep -q 'ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  [ "$(id -u)" = 0 ] || skip "run: sudo apt-get install ${missing[*]}"
  echo "installing ${missing[*]}"
  apt-get install -y -qq --no-install-recommends "${missing[@]}" > "$cache/install.log" 2>&1 \
    || { apt-get update -qq && apt-get install -y -qq --no-install-recommends "${missing[@]}"; } \
      >> "$cache/install.log" 2>&1 || skip "cannot install ${missing[*]}: see $cache/install.log"
fi

work=$(mktemp -d "$cache/build.XXXXXX")
trap 'rm -rf "$work"' EXIT
cd "$work"
echo "building the guest kernel from $source_package: a few minutes, once (log: $cache/build.log)"
apt-get download -q "$source_package" > "$cache/build.log" 2>&1 \
  || skip "cannot download $source_package: see $cache/build.log"
{
  dpkg -x "${source_package}"_*.deb .
  tar -xJf "usr/src/$source_package.tar.xz"
  rm -rf usr ./*.deb
  source=$work/$source_package
  out=$work/out
  mkdir "$out"
  quick=(make -s -C "$source" ARCH=um "O=$out")
  if command -v ccache; then quick+=("CC=ccache gcc"); fi
  "${quick[@]}" tinyconfig
  (cd "$source" && scripts/kconfig/merge_config.sh -O "$out" -m "$out/.config" "$here/uml.config")
  "${quick[@]}" olddefconfig
  "${quick[@]}" -j"$(nproc)"
  cp -r "$here/modules" modules
  "${quick[@]}" "M=$work/modules" modules
} >> "$cache/build.log" 2>&1 || {
  tail -n 20 "$cache/build.log" >&2
  echo "setup.sh: the guest kernel does not build: see $cache/build.log" >&2
  exit 1
}
rm -rf "$cache/modules"
mkdir "$cache/modules"
find modules out -name '*.ko' -exec cp {} "$cache/modules/" ';'
cp out/linux "$cache/linux.new"
mv "$cache/linux.new" "$cache/linux"
echo "$stamp" > "$cache/stamp"
echo "guest kernel: $cache"
