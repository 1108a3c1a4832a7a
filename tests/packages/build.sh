#!/usr/bin/env bash
# build.sh OUT [SOURCE]: builds the Debian packages of the tree as git sees it, uncommitted changes
# included, into the folder OUT, which is emptied. Works in the folder SOURCE (OUT-source when
# left out), which stays the same from run to run so that ccache recognises the files.
#
# With DTACT_BUILT=FOLDER in the environment nothing is compiled: the programs are those that
# `cmake --preset dev` built in FOLDER. Seconds instead of tens of minutes.
#
# Exit code: 0 built; 77 Debian's packages are missing (they are named); else failed.
set -euo pipefail
missing=()
for package in debhelper dh-python dpkg-dev python3-setuptools; do
  dpkg-query -W -f='${Status}' "$package" 2> /dev/null | grep -q 'ok installed' || missing+=("$package")
done
if ((${#missing[@]})); then
  echo "skipped: apt-get install ${missing[*]}" >&2
  exit 77
fi
out=$(readlink -m "$1")
source=$(readlink -m "${2:-$1-source}")
tree=$(cd "$(dirname "$0")/../.." && pwd)

rm -rf "$out" "$source"
mkdir -p "$out" "$source/dtactd"
(cd "$tree" && git ls-files -z --cached --others --exclude-standard \
  | tar --null --files-from=- --ignore-failed-read -c) | tar -x -C "$source/dtactd"

build_options=()
if [ -n "${DTACT_BUILT-}" ]; then
  DTACT_BUILT=$(readlink -e "$DTACT_BUILT")
  export DTACT_BUILT
  build_options=(--no-check-builddeps)
fi
# The page is built here: the package's build needs neither npm nor a network.
if [ -z "${DTACT_BUILT-}" ] && [ -e "$tree/clients/web/page/package.json" ]; then
  "$tree/clients/web/build_page.sh" "$tree/clients/web/page" "$tree" "$source/npm" "$source/page" npm
  export DTACT_WEB_PAGE=$source/page
fi
# debhelper gives the build an empty home folder.
if command -v ccache > /dev/null; then
  CCACHE_DIR=$(ccache --get-config cache_dir)
  export CCACHE_DIR
fi
cd "$source/dtactd"
dpkg-buildpackage --build=binary --no-sign "${build_options[@]}" > "$out/build.log" 2>&1 \
  || { tail -n 40 "$out/build.log" >&2; exit 1; }
mv ../*.deb ../*.changes ../*.buildinfo "$out"
