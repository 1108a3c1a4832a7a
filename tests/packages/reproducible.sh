#!/usr/bin/env bash
# reproducible.sh FOLDER: builds the packages in FOLDER, which build.sh made, again in another
# place, time zone and language, and compares them byte for byte. DTACT_BUILT as for build.sh.
#
# Exit code: 0 the same bytes; 77 there are no packages; else failed.
set -euo pipefail
compgen -G "$1/*.deb" > /dev/null || { echo "skipped: no packages in $1" >&2; exit 77; }
first=$(readlink -e "$1")
again=$first-again

TZ=Pacific/Kiritimati LC_ALL=C "$(dirname "$0")/build.sh" "$again" "$again-in/another/place"
different=0
for package in "$first"/*.deb; do
  cmp "$package" "$again/${package##*/}" || different=1
done
((different == 0)) || { echo "FAILED: diffoscope $first $again tells where" >&2; exit 1; }
rm -r "$again" "$again-in"
echo "the same bytes"
