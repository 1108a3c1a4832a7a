#!/usr/bin/env bash
# decoders_test.sh PAGE GOLDEN FOLDER: the page's decoders against the wire's golden vectors, under node.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
"$here/prepare.sh" "$1" "$3"
PAGE_NODE=$3/node GOLDEN=$2 node --test "$here/decoders_test.mjs"
