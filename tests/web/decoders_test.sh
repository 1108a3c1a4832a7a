#!/usr/bin/env bash
# decoders_test.sh PAGE GOLDEN FOLDER: the page's decoders against the wire's golden vectors and random
# maps, and the positions of a pose's axes, under node.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
"$here/prepare.sh" "$1" "$3"
/usr/bin/python3 -c 'import zstandard' || { echo "skipped: python3-zstandard is not installed"; exit 77; }
rm -rf "$3/random_maps"
/usr/bin/python3 -B "$here/random_maps.py" "$2" "$3/random_maps"
PAGE_NODE=$3/node GOLDEN=$2 RANDOM_MAPS=$3/random_maps node --test "$here/decoders_test.mjs" "$here/axes_test.mjs"
