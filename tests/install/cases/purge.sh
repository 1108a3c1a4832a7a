# shellcheck shell=bash disable=SC2154
# Purged, nothing is left of the packages: no file, no process, no unit.
rm -f /etc/dtactd/{left,right}.toml
apt_get purge dtactd dtact-tools libdtact1 libdtact-dev python3-dtact
files > /tmp/after
diff /tmp/before /tmp/after || fail "files are left or gone, see above"
pgrep dtactd && fail "it runs"
[ ! -e /run/dtactd ] || fail "left: $(find /run/dtactd)"
systemctl list-unit-files --no-legend | grep dtact | grep -v dtact-test && fail "units are left"
dpkg-query -W -f '${Status} ${Package}\n' | grep dtact && fail "dpkg remembers"
getent passwd dtactd
