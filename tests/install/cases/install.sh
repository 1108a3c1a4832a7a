# shellcheck shell=bash disable=SC2154
# The unmodified packages, installed by apt: the service runs and is enabled, and a client gets frames.
# The secret belongs to an administrator, although it is where the units look for it.
install -D -m 600 /dev/null /etc/credstore/dtactd@left.tokens
files > /tmp/before
apt_get install /job/packages/*.deb
grep -E '^(Creating|Created|W:|E:|warning)' /tmp/apt || true
[ "$(systemctl is-enabled dtactd)" = enabled ] || fail "not enabled"
within 300 serving
dtactctl status | head -n 3
frames 60 10
# What README shows next: depth, of the simulated sensor.
has_depth() {
  dtactctl watch --seconds 3 > /tmp/watch && grep '^simulated  ' /tmp/watch && grep ' frames, [1-9][0-9]* with depth' /tmp/watch
}
within 120 has_depth
say "$(tail -n 1 /tmp/watch)"
expect 'calibration  simulated, ' dtactctl status
systemctl status --no-pager dtactd | sed -n 's/^ *Status: /status: /p'
systemd-analyze security --no-pager dtactd | tail -n 1
[ "$(property NRestarts)" = 0 ] || fail "restarted: $(journalctl -b -u dtactd)"
# Drivers that this kernel lacks do not keep the daemon from running.
[ "$(systemctl show -p Result --value modprobe@{videodev,spidev,ws2812_pio_rp1}.service | sort -u | xargs)" = success ] \
  || fail "a driver's absence counts: $(systemctl list-units --all 'modprobe@*')"
# No process of it runs as root.
[ "$(ps -o user= -p "$(pid)")" = dtactd ] || fail "runs as $(ps -o user= -p "$(pid)")"
# For the other cases a scene without gel mechanics, which starts in a tenth of the time.
still_scene
cp "$config" /tmp/still.toml
