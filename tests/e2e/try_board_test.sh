#!/usr/bin/env bash
# try_board_test.sh SOURCE DTACTD DTACTCTL: the script for a first user of a board makes a report with
# the facts, the findings and a measurement, but without the home folder or a serial number; and
# dtactd accepts every board's configuration, except that one built without libcamera says so.
set -euo pipefail
source=$1 dtactd=$2 dtactctl=$3
for file in "$source"/config/boards/*.toml; do
  refused=$("$dtactd" --config "$file" --check-config 2>&1) ||
    [[ $refused == *"built without libcamera"* ]] || { echo "$refused"; exit 1; }
done

HOME=$(mktemp -d)
export HOME
trap 'rm -rf "$HOME"' EXIT
mkdir "$HOME/bin"
# Replaces the real one and prints characters that a camera's name may have.
cat >"$HOME/bin/dtactctl" <<PROGRAM
#!/bin/sh
echo "camera v4l2 serial:SN20250917, /dev/v4l/by-id/usb-Maker_SN20250917-video-index0, 800x600"
exec "$dtactctl" "\$@"
PROGRAM
chmod +x "$HOME/bin/dtactctl"
ln -s "$dtactd" "$HOME/bin/dtactd"
printf '[camera]\nbackend = "sim"\n' >"$HOME/board.toml"

report=$(PATH=$HOME/bin:$PATH "$source/config/boards/try-board.sh" "$HOME/board.toml" 3)
holds() { grep -qE "$1" <<<"$report" || { echo "$report"; echo "missing: $1"; exit 1; }; }
holds '^dtactd       [0-9]'
holds '^kernel       [0-9]'
holds '^configured   camera sim 800x600 at 60 fps, ring sim$'
holds '^clock source '
holds '^state        '
holds '^frames       [1-9][0-9]* published'
holds 'listening on 127\.0\.0\.1:'
holds '^camera v4l2 serial:…, /dev/v4l/by-id/…, 800x600$'
for secret in SN20250917 "$HOME"; do
  if grep -qF "$secret" <<<"$report"; then echo "$report"; echo "holds $secret"; exit 1; fi
done
