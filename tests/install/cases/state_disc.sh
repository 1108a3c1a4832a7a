# shellcheck shell=bash disable=SC2154,SC2034
# The disc of the state is full, or read-only: the daemon serves, reports what it cannot keep, and does not
# restart repeatedly.
trap 'umount -q -l /var/lib/dtactd || true' EXIT
on_small_disc() { # OPTIONS: mounts a disc of 256 kB as the state and starts the daemon
  systemctl stop dtactd
  mount -t tmpfs -o "size=256k,mode=700,uid=$(id -u dtactd),gid=$(id -g dtactd)" small /var/lib/dtactd
  "$@"
  systemctl restart dtactd || true
  within 120 serving
}
fill() { dd if=/dev/zero of=/var/lib/dtactd/ballast bs=4k 2> /dev/null || true; }
read_only() { mount -o remount,ro /var/lib/dtactd; }
for trouble in fill read_only; do
  say "$trouble"
  # What the journal says of the other trouble does not count.
  sleep 1
  since=$(date '+%F %T')
  on_small_disc "$trouble"
  before=$(pid)
  if dtactctl calibration upload /job/calibrations/old > /tmp/upload 2>&1; then fail "kept on no disc"; fi
  sed 's/^/client: /' /tmp/upload
  grep -qE 'No space left|Read-only file system' /tmp/upload || fail "the client is not told why"
  frames 60 10
  is_still "$before"
  [ "$(property NRestarts)" = 0 ] || fail "$(property NRestarts) restarts"
  # The journal explains the next day why it is gone.
  journal_says 'the daemon will start with the one before'
  systemctl stop dtactd
  umount /var/lib/dtactd
done
systemctl start dtactd
within 120 serving
dtactctl calibration upload /job/calibrations/old
