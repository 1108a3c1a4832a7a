#!/bin/bash
# setup.sh: makes the guest kernel of the kernel tests, once, in a cache folder.
#
# The kernel is User Mode Linux (a Linux kernel that runs as an ordinary program) built from
# Debian's linux-source-6.1 with uml.config, and the modules of modules/ beside it: about 4 minutes
# on 2 cores. It is made again when this, uml.config or a module changes. Nothing is installed but build
# tools, and those only by root. Every time, the kernel is booted once to see that it runs here.
#
# Exit code: 0 the kernel is there and runs; 77 it cannot be had on this machine; else it does not
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

stamp=$(cat "$here/setup.sh" "$here/uml.config" "$here"/modules/* | sha256sum | cut -c1-16)
is_ready() { [ -x "$cache/linux" ] && [ "$(cat "$cache/stamp" 2> /dev/null)" = "$stamp" ]; }

mkdir -p "$cache"
exec 9> "$cache/lock"
flock 9 # two test runs at once make one kernel

# change_once FILE FROM TO: replaces a text that must stand in the file exactly once.
change_once() {
  [ "$(grep -cF "$2" "$1")" = 1 ] || {
    echo "setup.sh: $1 of $source_package no longer has \"$2\" once: look how it is said now"
    return 1
  }
  sed -i "s/$2/$3/" "$1"
}

# build FOLDER: the kernel and its modules from Debian's source, in FOLDER.
build() (
  set -e
  cd "$1"
  dpkg -x "${source_package}"_*.deb .
  tar -xJf "usr/src/$source_package.tar.xz"
  rm -rf usr ./*.deb
  source=$1/$source_package
  out=$1/out
  # The space for a process's vector registers. The kernel can take them from the machine in part but
  # not give them back in part, and with AMX (Intel, since 2023) they are 11,008 bytes.
  change_once "$source/arch/x86/um/user-offsets.c" 'HOST_FP_SIZE, 2696)' 'HOST_FP_SIZE, 12288)'
  mkdir "$out"
  quick=(make -s -C "$source" ARCH=um "O=$out")
  if command -v ccache; then quick+=("CC=ccache gcc"); fi
  "${quick[@]}" tinyconfig
  (cd "$source" && scripts/kconfig/merge_config.sh -O "$out" -m "$out/.config" "$here/uml.config")
  "${quick[@]}" olddefconfig
  "${quick[@]}" -j"$(nproc)"
  cp -r "$here/modules" modules
  "${quick[@]}" "M=$1/modules" modules
)

make_kernel() {
  [ "$(uname -m)" = x86_64 ] || skip "User Mode Linux runs on x86-64, this is $(uname -m)"
  local missing=() package work built
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
  # shellcheck disable=SC2064  # the folder of now
  trap "rm -rf '$work'" EXIT
  echo "building the guest kernel from $source_package: a few minutes, once (log: $cache/build.log)"
  (cd "$work" && apt-get download -q "$source_package") > "$cache/build.log" 2>&1 \
    || skip "cannot download $source_package: see $cache/build.log"
  # Not as a condition, in which bash would go on after a step that failed.
  set +e
  build "$work" >> "$cache/build.log" 2>&1
  built=$?
  set -e
  if [ $built != 0 ]; then
    tail -n 20 "$cache/build.log" >&2
    echo "setup.sh: the guest kernel does not build: see $cache/build.log" >&2
    exit 1
  fi
  rm -rf "$cache/modules"
  mkdir "$cache/modules"
  find "$work/modules" "$work/out" -name '*.ko' -exec cp {} "$cache/modules/" ';'
  cp "$work/out/linux" "$cache/linux.new"
  mv "$cache/linux.new" "$cache/linux"
  echo "$stamp" > "$cache/stamp"
}

is_ready || make_kernel
"$here/selftest"
echo "guest kernel: $cache"
