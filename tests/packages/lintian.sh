#!/usr/bin/env bash
# lintian.sh FOLDER: Debian's own check of the packages in FOLDER, without errors or warnings.
#
# Exit code: 0 passed; 77 lintian is not installed or there are no packages; else failed.
set -euo pipefail
command -v lintian > /dev/null || { echo "skipped: apt-get install lintian" >&2; exit 77; }
compgen -G "$1/*.changes" > /dev/null || { echo "skipped: no packages in $1" >&2; exit 77; }
# The packages are not part of Debian: there is no report of an intended package that they close.
lintian --fail-on error,warning --suppress-tags initial-upload-closes-no-bugs \
  --allow-root --tag-display-limit 0 "$1"/*.changes
echo "clean"
