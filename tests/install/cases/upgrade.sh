# shellcheck shell=bash disable=SC2154
# A newer version over this one; both the administrator and the newer version changed the configuration. A
# second sensor, the page and dtact-dds are enabled beside it.
within 120 serving
echo '# kept by the administrator' >> "$config"
cp "$config" /tmp/edited.toml
dtactctl calibration upload /job/calibrations/old --name kept
instance left 7401
systemctl enable -q --now dtact-web dtact-dds
units=(dtactd dtactd@left dtact-web dtact-dds)
program() { readlink "/proc/$(pid "$1")/exe"; }
for unit in "${units[@]}"; do say "$unit: $(program "$unit")"; done
apt_get -o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold install /job/newer/*.deb
cmp "$config" /tmp/edited.toml || fail "the edited configuration was not kept"
[ -e "$config.dpkg-dist" ] || fail "the newer configuration is not beside it: $(ls /etc/dtactd)"
[[ $(dpkg-query -W -f '${Version}' dtactd) == *.newer ]] || fail "not upgraded"
within 120 serving
within 120 dtactctl --port 7401 status
for unit in "${units[@]}"; do
  # For a replaced file the kernel appends "(deleted)".
  [[ $(program "$unit") =~ ^/usr/bin/[a-z-]+$ ]] || fail "$unit: the old program still runs: $(program "$unit")"
done
# This unit was not enabled.
[ "$(property ActiveState dtact-perceive)" = inactive ] || fail "dtact-perceive was started"
systemctl disable -q --now dtactd@left dtact-web dtact-dds
rm /etc/dtactd/left.toml
expect kept dtactctl calibration list
