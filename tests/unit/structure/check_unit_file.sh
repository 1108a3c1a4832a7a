#!/usr/bin/env bash
# systemd-analyze verify, with the program where it was built: the installed path need not exist.
set -euo pipefail
unit=$1 program=$2
command -v systemd-analyze >/dev/null || { echo "systemd-analyze is not installed"; exit 1; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
sed "s|/usr/bin/dtactd|$program|" "$unit" >"$folder/dtactd.service"
output=$(systemd-analyze verify --man=no "$folder/dtactd.service" 2>&1) || { echo "$output"; exit 1; }
if grep -F dtactd <<<"$output"; then exit 1; fi
echo "clean"
