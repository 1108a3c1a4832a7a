#!/usr/bin/env bash
# npm_test.sh MCAP_SAMPLE FOLDER: files of ours read by @mcap/core, and files of its by ours.
set -euo pipefail
sample=$1 folder=$2
here=$(cd "$(dirname "$0")" && pwd)
skip() {
  echo "skipped: $1"
  exit 77
}
for tool in node npm; do
  command -v "$tool" >/dev/null || skip "$tool is not installed"
done
mkdir -p "$folder"
cp "$here/package.json" "$here/npm.mjs" "$folder/"
cd "$folder"
if [[ ! -d node_modules/@mcap/core || package.json -nt node_modules ]]; then
  npm install --no-audit --no-fund --no-package-lock --fetch-retries=0 --fetch-timeout=30000 \
    >npm.log 2>&1 || skip "npm cannot install @mcap/core: $(tail -1 npm.log)"
  touch node_modules
fi

cat >expected <<'EOF'
message /a S 0 100 90 {"i":0}
message /b - 1 101 91 {"i":1}
message /a S 2 102 92 {"i":2}
message /b - 3 103 93 {"i":3}
message /a S 4 104 94 {"i":4}
message /b - 5 105 95 {"i":5}
attachment a.txt text/plain 5 4 attached
metadata m key=value
EOF
"$sample" write ours.mcap
node npm.mjs read ours.mcap >reported
cat expected - <<'EOF' | diff - reported
statistics 6 1 2 1 1 2 100 105 1:3,2:3
streamed 6 true
EOF
node npm.mjs write theirs.mcap
"$sample" read theirs.mcap | diff expected -
echo "both ways"
