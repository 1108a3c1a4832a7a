#!/usr/bin/env bash
# package.sh SUITE ARCHITECTURE OUT: builds the Debian packages for Debian's release SUITE (bookworm,
# trixie) and ARCHITECTURE (amd64, arm64) into the folder OUT, which is emptied: in a chroot, and for
# another architecture than this machine's by a cross-build. Build dependencies are installed as in
# debian/control.
#
# Exit code: 0 built; 77 the chroot cannot be made here (the reason is printed); else failed.
set -euo pipefail
suite=$1 architecture=$2 out=$(readlink -m "$3")
native=$(dpkg --print-architecture)
root=${CHROOT_CACHE:-$HOME/.cache/dtactd-chroots}/$suite
setup=true packages=(build-essential ccache)
if [ "$architecture" != "$native" ]; then
  [ "$native" = amd64 ] || skip "this machine is $native; only amd64 builds for another architecture"
  root+=-$architecture
  setup="dpkg --add-architecture $architecture"
  packages+=("crossbuild-essential-$architecture")
fi
# shellcheck source=tests/platform/chroot.sh
. "$(dirname "$0")/chroot.sh"

prepare "$setup" "${packages[@]}"
copy_source
inside "apt-get build-dep -y -qq --no-install-recommends --host-architecture $architecture /source" \
  >> "$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; exit 1; }
echo "package.sh: building for Debian $suite, $architecture"
package "$out" "$architecture"
