# shellcheck shell=bash disable=SC2154
# After a purge nothing of the packages is left: no file, no process, no unit; nor of a second sensor, of the page and
# of dtact-dds, which run when they are removed. When they are installed again before that, enabled units return.
instance left 7401
systemctl enable -q --now dtact-web dtact-dds
within 120 bash -c 'ss -ltn | grep -q 127.0.0.1:7380'
within 120 bash -c 'journalctl --no-pager -o cat -b -u dtact-dds | grep -F "sensor is there: dtactd"'
running() { pgrep -l -x dtactd || pgrep -l -x dtact-web || pgrep -l -x dtact-dds; }
instance right 7402
systemctl disable -q dtactd@right
apt_get remove dtactd dtact-tools dtact-dds
running && fail "it runs from programs that are gone"
[ -e "$config" ] || fail "a removal took the configuration"
apt_get -o Dpkg::Options::=--force-confold install /job/packages/dtact{d,-tools}_*.deb
within 300 dtactctl --port 7401 status
[ "$(property ActiveState dtactd@right)" = inactive ] || fail "an instance that was not enabled was started"
apt_get remove dtactd dtact-tools
running && fail "it runs from programs that are gone"
# A folder that is a disc of its own is emptied, and the purge does not fail for its mount point.
discs=(/var/lib/dtactd /var/lib/private/dtact-web)
for disc in "${discs[@]}"; do mount --bind "$disc" "$disc"; done
apt_get purge dtactd dtact-dds dtact-tools libdtact1 libdtact-dev python3-dtact
for disc in "${discs[@]}"; do
  [ -z "$(ls -A "$disc")" ] || fail "left: $(find "$disc")"
  umount "$disc"
  rmdir "$disc"
done
files > /tmp/after
# /etc/credstore stays, because its secrets are the administrator's.
diff /tmp/before /tmp/after || fail "files are left or gone, see above"
running && fail "it runs"
[ ! -e /run/dtactd ] || fail "left: $(find /run/dtactd)"
systemctl list-unit-files --no-legend | grep dtact | grep -v dtact-test && fail "units are left"
dpkg-query -W -f '${Status} ${Package}\n' | grep dtact && fail "dpkg remembers"
getent passwd dtactd
