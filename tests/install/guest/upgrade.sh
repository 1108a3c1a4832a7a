# shellcheck shell=bash
# Upgrades until the power is cut; with "repair" it does what an administrator does afterwards.
if [ "${1-}" != repair ]; then
  within 300 serving
  # One file for each step that dpkg reports.
  dpkg -i --status-fd 3 --force-confdef --force-confold /job/newer/*.deb 3>&1 > /tmp/dpkg \
    | { step=0; while read -r _; do touch "/job/steps/$((step += 1))"; done; }
  touch /job/done
  sleep 600
fi
[ "$(property Result systemd-fsck-root.service)" = success ] || fail "the file system is broken"
has_old() {
  within 300 serving
  export_calibration
  same old || fail "not the calibration that was uploaded: $(ls -la /tmp/export; dtactctl calibration list)"
  dtactctl status | grep -q uncalibrated && fail "the calibration is not used"
  return 0
}
# A robot without an administrator is in this state.
has_old
say "before the repair the daemon is there, with its calibration"
say "versions: $(dpkg-query -W -f '${Package} ${Version} ${db:Status-Abbrev}, ' '*dtact*')"
dpkg --force-confdef --force-confold --configure -a > /tmp/configure 2>&1 || say "dpkg --configure -a: $(tail -n 3 /tmp/configure)"
if [ -n "$(dpkg --audit)" ] || dpkg-query -W -f '${Version}\n' '*dtact*' | grep -qv newer; then
  say "again: dpkg -i"
  dpkg -i --force-confdef --force-confold /job/newer/*.deb > /tmp/again 2>&1 || fail "$(cat /tmp/again)"
fi
[ -z "$(dpkg --audit)" ] || fail "$(dpkg --audit)"
has_old
say "the daemon is there, with its calibration"
