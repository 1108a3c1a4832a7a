#!/usr/bin/env bash
# systemd-analyze verify, with the program where it was built: the installed path need not exist. Then
# what keeps a daemon from being given up.
set -euo pipefail
unit=$1 program=$2
command -v systemd-analyze >/dev/null || { echo "systemd-analyze is not installed"; exit 1; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# verify: the first complaint about our unit, or nothing.
verify() {
  local output
  output=$(systemd-analyze verify --man=no "$folder/dtactd.service" 2>&1) || { echo "$output"; return; }
  grep -F dtactd <<<"$output" || true
}

sed "s|/usr/bin/dtactd|$program|" "$unit" >"$folder/dtactd.service"
complaint=$(verify)
[[ -z $complaint ]] || { echo "$complaint"; exit 1; }

grep -qx 'StartLimitIntervalSec=0' "$unit" || { echo "the unit gives up after five failures"; exit 1; }
! grep -qE '^[^#]*network-online' "$unit" || { echo "the unit waits for the network"; exit 1; }

# The back-off is for systemd 254 and later; an older one knows neither key, and both are all it says.
cp -r "$unit.d" "$folder/dtactd.service.d"
complaint=$(verify)
if (($(systemctl --version | sed -n '1s/systemd \([0-9]*\).*/\1/p') < 254)); then
  complaint=$(grep -vE "Unknown key '(RestartSteps|RestartMaxDelaySec)'" <<<"$complaint" || true)
fi
[[ -z $complaint ]] || { echo "$complaint"; exit 1; }
echo "clean"
