#!/usr/bin/env bash
# prepare.sh PAGE FOLDER [browser]: makes the prerequisites of the page's tests in FOLDER: the bundles of its
# decoders, and for the browser's tests playwright-core. Status 77, with the reason, where it cannot.
set -euo pipefail
page=$1 folder=$2 browser=${3-}
here=$(cd "$(dirname "$0")" && pwd)
skip() {
  echo "skipped: $1"
  exit 77
}
for tool in node npm protoc ${browser:+chromium}; do
  command -v "$tool" >/dev/null || skip "$tool is not installed"
done

# install SOURCE FOLDER: the packages of SOURCE/package-lock.json in FOLDER, unless they are there.
install() {
  mkdir -p "$2"
  if cmp -s "$1/package-lock.json" "$2/package-lock.json" && [[ -e $2/node_modules/.complete ]]; then return; fi
  cp "$1/package.json" "$1/package-lock.json" "$2"
  # No package's script runs: esbuild's program comes as a package of its own.
  npm --prefix "$2" ci --ignore-scripts --no-audit --no-fund --fetch-retries=0 --fetch-timeout=30000 \
    >"$2/npm.log" 2>&1 || skip "npm cannot install what $1 needs: $(tail -1 "$2/npm.log")"
  touch "$2/node_modules/.complete"
}

mkdir -p "$folder"
exec 9>"$folder/lock"
flock 9  # The tests may run at the same time.
install "$page" "$folder/page"
if [[ -n $browser ]]; then install "$here" "$folder/browser"; fi
rm -rf "$folder/page/src"
cp -r "$page/src" "$page/build.mjs" "$page/tsconfig.json" "$folder/page"
cd "$folder/page"
npm run --silent build -- --node "$folder/node" --tree "$page/../../.."
