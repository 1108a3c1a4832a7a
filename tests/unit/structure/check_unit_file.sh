#!/usr/bin/env bash
# The units of systemd/ are well formed, hardened, consistent, and restarted without end.
# check_unit_file.sh SYSTEMD_FOLDER DTACTD
set -euo pipefail
source=$1 program=$2
command -v systemd-analyze >/dev/null || { echo "skipped: systemd-analyze is not installed"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $1"; exit 1; }

# verify FILE: the complaints about our units, or nothing. The program is one that was built: the
# installed path need not exist.
verify() {
  local output
  output=$(systemd-analyze verify --man=no "$folder/$1" 2>&1) || { echo "$output"; return; }
  grep -F dtact <<<"$output" || true
}

built() { sed -E "s#/usr/bin/dtact(d|-dds|-perceive|-web)#$program#"; }

for unit in dtactd.service dtactd@.service dtact-dds.service dtact-perceive.service dtact-web.service; do
  built <"$source/$unit" >"$folder/$unit"
  complaint=$(verify "$unit")
  [[ -z $complaint ]] || fail "$complaint"
  # In tenths: 1.3. What is left is what the sensor needs: its devices, FIFO, the network.
  systemd-analyze security --offline=true --no-pager --threshold=13 "$folder/$unit" >"$folder/score" ||
    fail "$unit is too exposed: $(grep -v '^✓' "$folder/score")"
  tail -n 1 "$folder/score"
  grep -qx 'StartLimitIntervalSec=0' "$source/$unit" || fail "$unit gives up after five failures"
  ! grep -qE '^[^#]*network-online' "$source/$unit" || fail "$unit waits for the network"
  for line in 'MemoryMax=[0-9]+%' 'TasksMax=[0-9]+' 'LimitCORE=0' 'OOMScoreAdjust=-?[0-9]+'; do
    grep -qxE "$line" "$source/$unit" || fail "$unit has no $line"
  done
done
for unit in dtactd.service dtactd@.service; do
  grep -qx 'LimitNOFILE=4096' "$source/$unit" || fail "$unit has no room for net.max_clients = 1024"
  # The drivers that are modules, by the kind of device that systemd has to know.
  for driver in video4linux:videodev spi:spidev ws2812-pio-rp1:ws2812_pio_rp1; do
    for line in "DeviceAllow=char-${driver%:*} rw" "Wants=.*modprobe@${driver#*:}\.service.*" \
      "After=.*modprobe@${driver#*:}\.service.*"; do
      grep -qx "$line" "$source/$unit" || fail "$unit has no $line"
    done
  done
  # These would improve the units' score and slow the capture thread down.
  ! grep -qE '^(RestrictRealtime=yes|SystemCallFilter=~.*@resources)' "$source/$unit" || fail "$unit forbids FIFO"
done

# The drop-in that a comment shows, with which a token reaches the service's own user.
for unit in dtact-dds.service dtact-perceive.service dtact-web.service; do
  mkdir "$folder/$unit.d"
  sed -n 's/^#   //p' "$source/$unit" | built >"$folder/$unit.d/token.conf"
  grep -q '^LoadCredential=token:' "$folder/$unit.d/token.conf" || fail "$unit does not say how it gets a token"
  complaint=$(verify "$unit")
  [[ -z $complaint ]] || fail "$unit: its drop-in: $complaint"
done

# The instances are the same service under other names, by which clients know them. Only dtactd.service keeps its folder in
# /run, because the instances share it.
settings() { grep -vE '^(#|$)' "$source/$1"; }
difference=$(diff <(settings dtactd.service | sed -E '/^RuntimeDirectoryPreserve=yes$/d
    s|^ExecStart=|Environment=DTACTD_NAME=%H-%i\n&|
    s|/etc/dtactd/dtactd\.toml|/etc/dtactd/%i.toml|; s|^(Description=.*)|\1, %i|
    s|^(State\|Runtime)Directory=dtactd$|&/%i|; s|^(LoadCredential=.*:dtactd)|\1@%i|') \
  <(settings dtactd@.service)) || fail "the template differs: $difference"

# The back-off needs systemd 254; an older one ignores both keys and reports only that.
for unit in dtactd.service dtactd@.service; do
  mkdir "$folder/$unit.d"
  cp "$source/back-off.conf" "$source/network.conf" "$folder/$unit.d"
  complaint=$(verify "$unit")
  if (($(systemctl --version | sed -n '1s/systemd \([0-9]*\).*/\1/p') < 254)); then
    complaint=$(grep -vE "Unknown key '(RestartSteps|RestartMaxDelaySec)'" <<<"$complaint" || true)
  fi
  [[ -z $complaint ]] || fail "$complaint"
done
cp "$source/devices.conf" "$folder/dtactd@.service.d"
complaint=$(verify dtactd@.service)
[[ -z $complaint ]] || grep -vE "Unknown key '(RestartSteps|RestartMaxDelaySec)'" <<<"$complaint" ||
  complaint=
[[ -z $complaint ]] || fail "devices.conf: $complaint"
echo "clean"
