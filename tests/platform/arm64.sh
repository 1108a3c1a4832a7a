#!/usr/bin/env bash
# arm64.sh PACKAGE...: cross-builds the programs for arm64 on Debian 12, in a chroot so that the other
# architecture's packages stay out of this machine, and runs under qemu-user the unit tests of what has
# instructions or a byte order of its own there. Of the Debian packages named, libraries are taken for arm64 and tools for this machine;
# umockdev is both, and the tests load its library. Makes Debian packages of what it built, in
# build/dev/packages-debian12-arm64, installs them there, has the daemon serve a client on the simulated
# sensor, each under qemu-user, and purges them.
#
# Exit code: 0 passed; 77 the chroot cannot be made here (the reason is printed); else failed.
set -euo pipefail
suite=bookworm
root=${CHROOT_CACHE:-$HOME/.cache/dtactd-chroots}/$suite-arm64
# shellcheck source=tests/platform/chroot.sh
. "$(dirname "$0")/chroot.sh"

[ "$(uname -m)" = x86_64 ] || skip "this machine is $(uname -m)"
foreign=()
for package in "$@"; do
  case $package in
    libcli11-dev | libeigen3-dev) foreign+=("$package") ;;  # these have no architecture
    lib* | cyclonedds-dev | prometheus-cpp-dev | umockdev) foreign+=("$package:arm64") ;;
    *) foreign+=("$package") ;;
  esac
done
prepare 'dpkg --add-architecture arm64' crossbuild-essential-arm64 qemu-user-static "${foreign[@]}"
copy_source
cp "$(dirname "$0")/arm64.cmake" "$root/arm64.cmake"
echo "arm64.sh: building"
# An interrupted run leaves its packages installed, and tests would take those programs for this machine's.
# shellcheck disable=SC2016  # the inner shell expands it
inside 'dpkg-query -W -f "\${binary:Package}\n" "dtact*" "libdtact*" 2> /dev/null | xargs -r dpkg --purge > /purge.log
  cd /source
  cmake --preset dev -B /build --toolchain /arm64.cmake > /build.log
  own="recon_test luma_test mjpeg_test wire_test geometry_test"
  cmake --build /build --target daemon/all clients/all $own > /build.log 2>&1 || { grep -v "^\[" /build.log; exit 1; }
  ctest --test-dir /build --output-on-failure -j"$(nproc)" -R "^(${own// /|})\$"'
package "$source_folder/build/dev/packages-debian12-arm64" arm64 /build
echo "arm64.sh: installing the packages"
# shellcheck disable=SC2016  # the inner shell expands it
inside 'cd /packages
  apt-get install -y -qq --no-install-recommends ./dtactd_*.deb ./dtact-tools_*.deb ./libdtact1_*.deb > /packages/apt.log 2>&1 \
    || { cat /packages/apt.log; exit 1; }
  client() { qemu-aarch64-static /usr/bin/dtactctl --host unix:/packages/dtactd.sock "$@"; }
  rm -rf /packages/state
  qemu-aarch64-static /usr/bin/dtactd --config /etc/dtactd/dtactd.toml --set state_dir=/packages/state --set net.address= \
    --set net.unix_socket=/packages/dtactd.sock --set camera.fps=10 &> /packages/daemon.log &
  daemon=$!
  trap "kill $daemon 2> /dev/null || true; cat /packages/daemon.log" EXIT
  end=$((SECONDS + 300))
  until client status > /packages/status.log 2>&1; do
    ((SECONDS < end)) || { cat /packages/status.log; exit 1; }
    sleep 1
  done
  watched=$(client watch --summary --seconds 10 | tail -n 1)
  echo "$watched"
  [[ $watched =~ :\ ([0-9]+)\ frames ]] && ((BASH_REMATCH[1] >= 10)) || { echo "arm64.sh: fewer than 10 frames"; exit 1; }
  kill $daemon
  wait $daemon
  trap - EXIT
  apt-get purge -y -qq dtactd:arm64 dtact-tools:arm64 libdtact1:arm64 > /packages/apt.log 2>&1
  left=$(ls -d /etc/dtactd /usr/bin/dtact* /lib/systemd/system/dtact* 2> /dev/null || true)
  [ -z "$left" ] || { echo "arm64.sh: purge leaves $left"; exit 1; }'
