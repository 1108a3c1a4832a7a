#!/bin/bash
# setup.sh: makes the guest kernel of the kernel tests, once, in a cache folder.
#
# The kernel is User Mode Linux (a Linux kernel that runs as an ordinary program) built from
# Debian's linux-source-6.1 with uml.config: 2 to 7 minutes on 2 cores. The files for building modules are
# kept beside it, so that a change in modules/ rebuilds only those, in seconds. Nothing is
# installed but build tools, and those only by root. Every time, the kernel is booted once to check that
# it runs here.
#
# Exit code: 0 the kernel is there and runs; 77 it cannot be made on this machine; else it does not
# build or does not run here. The reason is printed.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cache=${KERNEL_CACHE:-$HOME/.cache/dtactd-kernel}
source_package=linux-source-6.1
packages=(build-essential bc bison flex libelf-dev kmod busybox-static xz-utils iproute2)

skip() {
  echo "kernel tests: no guest kernel: $*" >&2
  exit 77
}

mkdir -p "$cache"
exec 9> "$cache/lock"
flock 9 # two test runs at once make one kernel

# change_once FILE FROM TO: replaces a text that must be in the file exactly once.
change_once() {
  [ "$(grep -cF "$2" "$1")" = 1 ] || {
    echo "setup.sh: $1 of $source_package no longer has \"$2\" once: look how it is said now"
    return 1
  }
  sed -i "s/$2/$3/" "$1"
}

# build_kernel FOLDER: builds the kernel, its modules and the files for building modules.
build_kernel() (
  set -e
  cd "$1"
  dpkg -x "${source_package}"_*.deb .
  tar -xJf "usr/src/$source_package.tar.xz"
  rm -rf usr ./*.deb
  # The space for a process's vector registers. The kernel can take them from the machine in part but
  # not give them back in part, and with AMX (Intel, since 2023) they are 11,008 bytes.
  change_once "$source_package/arch/x86/um/user-offsets.c" 'HOST_FP_SIZE, 2696)' 'HOST_FP_SIZE, 12288)'
  mkdir out in-tree
  quick=(make -s -C "$1/$source_package" ARCH=um "O=$1/out")
  if command -v ccache; then quick+=("CC=ccache gcc"); fi
  "${quick[@]}" tinyconfig
  (cd "$source_package" && scripts/kconfig/merge_config.sh -O ../out -m ../out/.config "$here/uml.config")
  "${quick[@]}" olddefconfig
  "${quick[@]}" -j"$(nproc)"
  mv out/linux .
  find out -name '*.ko' -exec cp {} in-tree/ ';'
  mkdir headers
  (cd "$source_package" && cp -r --parents Makefile scripts include arch/um arch/x86 ../headers/)
  rm -rf "$source_package"
  find out -mindepth 1 -maxdepth 1 ! -name include ! -name arch ! -name scripts ! -name .config \
    ! -name Module.symvers -exec rm -rf {} +
  find out headers -name '*.o' -delete
)

# build_modules FOLDER: builds modules/ with build_kernel's files there.
build_modules() (
  set -e
  rm -rf "$1/modules"
  cp -r "$here/modules" "$1/modules"
  make -s -C "$1/headers" ARCH=um "O=$1/out" "M=$1/modules" modules
)

need_tools() {
  [ "$(uname -m)" = x86_64 ] || skip "User Mode Linux runs on x86-64, this is $(uname -m)"
  local missing=() package
  for package in "${packages[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2> /dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  [ "$(id -u)" = 0 ] || skip "run: sudo apt-get install ${missing[*]}"
  echo "installing ${missing[*]}"
  apt-get install -y -qq --no-install-recommends "${missing[@]}" > "$cache/install.log" 2>&1 \
    || { apt-get update -qq && apt-get install -y -qq --no-install-recommends "${missing[@]}"; } \
      >> "$cache/install.log" 2>&1 || skip "cannot install ${missing[*]}: see $cache/install.log"
}

# logged COMMAND...: runs it; where it fails, shows the end of the log and ends.
logged() {
  local built
  # Not as an `if`, in which bash would continue after a step that failed.
  set +e
  "$@" >> "$cache/build.log" 2>&1
  built=$?
  set -e
  [ $built = 0 ] && return
  tail -n 20 "$cache/build.log" >&2
  echo "setup.sh: $1 failed: see $cache/build.log" >&2
  exit 1
}

stamp_of() { sha256sum | cut -c1-16; }
is_stamped() { [ "$(cat "$cache/$1" 2> /dev/null)" = "$2" ]; }

# The kernel depends on its configuration and its recipe; the modules depend on the kernel.
kernel_stamp=$({ declare -f change_once build_kernel; cat "$here/uml.config"; } | stamp_of)
modules_stamp=$({ echo "$kernel_stamp"; declare -f build_modules; cat "$here"/modules/*; } | stamp_of)

if ! is_stamped stamp "$kernel_stamp"; then
  need_tools
  # Always the same folder, so that ccache knows what it has built there before.
  work=$cache/build.new
  trap 'rm -rf "$work"' EXIT
  rm -rf "$work" "$cache/modules.stamp"
  mkdir "$work"
  echo "building the guest kernel from $source_package: a few minutes, once (log: $cache/build.log)"
  (cd "$work" && apt-get download -q "$source_package") > "$cache/build.log" 2>&1 \
    || skip "cannot download $source_package: see $cache/build.log"
  logged build_kernel "$work"
  rm -rf "$cache/modules" "$cache/build"
  mv "$work/in-tree" "$cache/modules"
  mv "$work/linux" "$cache/linux"
  mv "$work" "$cache/build"
  echo "$kernel_stamp" > "$cache/stamp"
fi
if ! is_stamped modules.stamp "$modules_stamp"; then
  need_tools
  logged build_modules "$cache/build"
  cp "$cache/build/modules"/*.ko "$cache/modules/"
  echo "$modules_stamp" > "$cache/modules.stamp"
fi
"$here/selftest"
echo "guest kernel: $cache"
