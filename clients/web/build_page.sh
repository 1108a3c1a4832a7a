#!/usr/bin/env bash
# build_page.sh SOURCES TREE WORK OUT NPM: builds the page of the folder SOURCES into the folder OUT, which is
# emptied. npm works in the folder WORK, so that the tree stays as it is; TREE is the repository, whose messages
# it uses.
set -euo pipefail
sources=$1 tree=$2 work=$3 out=$4 npm=$5
mkdir -p "$work"
# What npm has installed stays.
find "$work" -mindepth 1 -maxdepth 1 ! -name node_modules -exec rm -rf {} +
tar -C "$sources" --exclude=./node_modules --exclude=./gen -c . | tar -C "$work" -x
cd "$work"
say() { echo "build_page.sh: $*" >&2; }
command -v "$npm" >/dev/null || { say "there is no $npm: apt-get install nodejs npm"; exit 1; }
if ! cmp -s package-lock.json node_modules/.installed; then
  "$npm" ci --ignore-scripts --no-audit --no-fund --loglevel=error >&2 || {
    say "npm cannot install what the page is built with: it needs the network once, or a registry (npm config" \
      "set registry); or give cmake -DDTACT_WEB_PAGE=FOLDER a page that is built, or OFF for none"
    exit 1
  }
  cp package-lock.json node_modules/.installed
fi
rm -rf "$out"
"$npm" run --silent build -- --outdir "$out" --tree "$tree" >&2
[[ -f $out/index.html ]] || { say "the page's build left no index.html in $out"; exit 1; }
