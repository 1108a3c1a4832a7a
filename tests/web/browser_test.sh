#!/usr/bin/env bash
# browser_test.sh PAGE FOLDER TEST: a test of the page in Chromium. The environment names the programs, see
# programs.mjs; screenshots stay in FOLDER/run-*.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
"$here/prepare.sh" "$1" "$2" browser
rm -rf "$2/run-${3%%_*}"-*
FOLDER=$2 PAGE_NODE=$2/node node --test --test-concurrency=1 "$here/$3"
