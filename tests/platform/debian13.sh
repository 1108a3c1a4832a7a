#!/usr/bin/env bash
# debian13.sh PACKAGE...: builds the whole tree on Debian 13 (gcc 14, libgpiod 2) in a chroot, with
# the Debian packages named, and runs the unit tests there. Makes Debian packages of what it built, in
# build/dev/packages-debian13-amd64 for example.
#
# Exit code: 0 passed; 77 the chroot cannot be made here (the reason is printed); else failed.
set -euo pipefail
suite=trixie
root=${CHROOT_CACHE:-$HOME/.cache/dtactd-chroots}/$suite
# shellcheck source=tests/platform/chroot.sh
. "$(dirname "$0")/chroot.sh"

prepare true "$@"
copy_source
echo "debian13.sh: building"
inside 'cd /source
  cmake --preset dev -B /build > /build.log
  cmake --build /build > /build.log 2>&1 || { grep -v "^\[" /build.log; exit 1; }
  ctest --test-dir /build --output-on-failure -L unit'
architecture=$(dpkg --print-architecture)
package "$source_folder/build/dev/packages-debian13-$architecture" "$architecture" /build
