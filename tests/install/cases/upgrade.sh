# shellcheck shell=bash disable=SC2154
# A newer version over this one, whose configuration the administrator has edited and the newer one too.
within 120 serving
echo '# kept by the administrator' >> "$config"
cp "$config" /tmp/edited.toml
dtactctl calibration upload /job/calibrations/old --name kept
before=$(pid)
apt_get -o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold install /job/newer/*.deb
cmp "$config" /tmp/edited.toml || fail "the edited configuration was not kept"
[ -e "$config.dpkg-dist" ] || fail "the newer configuration is not beside it: $(ls /etc/dtactd)"
[[ $(dpkg-query -W -f '${Version}' dtactd) == *.newer ]] || fail "not upgraded"
within 120 serving
other_pid "$before" || fail "the old program still runs"
expect kept dtactctl calibration list
