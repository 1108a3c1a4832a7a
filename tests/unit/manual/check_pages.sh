#!/usr/bin/env bash
# check_pages.sh PAGE...: man shows each page without a warning, and mandoc finds no fault.
set -euo pipefail
for program in man mandoc; do
  command -v "$program" >/dev/null || { echo "skipped: $program is not installed"; exit 77; }
done
status=0
for page in "$@"; do
  # lintian runs man in the same way: https://lintian.debian.org/tags/groff-message
  said=$(LC_ALL=C.UTF-8 MANROFFSEQ='' MANWIDTH=80 man --warnings -E UTF-8 -l -Tutf8 -Z "$page" 2>&1 >/dev/null)
  # A generated page has no date, and its text is not one sentence a line: warnings, not errors.
  said+=$(mandoc -T lint -W error "$page" || true)
  [[ -z $said ]] || { echo "$page: $said" >&2; status=1; }
done
exit $status
