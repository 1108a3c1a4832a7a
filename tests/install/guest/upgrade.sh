# shellcheck shell=bash
# Upgrades until the power goes; with "repair" what an administrator does after it went.
if [ "${1-}" != repair ]; then
  within 300 serving
  touch /job/begun
  dpkg -i --force-confdef --force-confold /job/newer/*.deb
  touch /job/done
  sleep 600
fi
[ "$(property Result systemd-fsck-root.service)" = success ] || fail "the file system is broken"
say "versions: $(dpkg-query -W -f '${Package} ${Version} ${db:Status-Abbrev}, ' '*dtact*')"
dpkg --force-confdef --force-confold --configure -a > /tmp/configure 2>&1 || say "dpkg --configure -a: $(tail -n 3 /tmp/configure)"
if [ -n "$(dpkg --audit)" ] || dpkg-query -W -f '${Version}\n' '*dtact*' | grep -qv newer; then
  say "again: dpkg -i"
  dpkg -i --force-confdef --force-confold /job/newer/*.deb > /tmp/again 2>&1 || fail "$(cat /tmp/again)"
fi
[ -z "$(dpkg --audit)" ] || fail "$(dpkg --audit)"
within 300 serving
expect old dtactctl calibration list
dtactctl status | grep -q uncalibrated && fail "the calibration is gone"
say "the daemon is there, with its calibration"
