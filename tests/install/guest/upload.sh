# shellcheck shell=bash
# After a power cut or without: the disc is clean, the daemon runs, every calibration that it has is one that was
# sent, complete. Then uploads calibrations until the power is cut, unless called with "only_look".
[ "$(property Result systemd-fsck-root.service)" = success ] || fail "the file system is broken"
within 300 serving
expect '*' dtactctl calibration list
export_calibration
if same old; then say "has the old one"; elif same new; then say "has the new one"; else
  fail "neither the old nor the new calibration: $(ls -la /tmp/export; dtactctl calibration list)"
fi
dtactctl status | grep -q uncalibrated && fail "the calibration is not used"
[ "${1-}" = only_look ] && exit 0
touch /job/begun
while :; do
  for name in new old; do
    dtactctl calibration upload "/job/calibrations/$name" --name "$name"
    echo sent >> /job/uploads
  done
done
