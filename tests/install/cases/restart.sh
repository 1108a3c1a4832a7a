# shellcheck shell=bash disable=SC2154
# The administrator restarts it; it is killed; a signal stops it, like a hang: each time it runs again.
before=$(pid)
systemctl restart dtactd
within 120 serving
other_pid "$before" || fail "not restarted"
say "kill -9"
before=$(pid)
kill -KILL "$before"
within 120 other_pid "$before"
within 120 serving
say "SIGSTOP"
before=$(pid)
kill -STOP "$before"
within 120 other_pid "$before"
within 120 serving
within 30 journal_says 'Watchdog timeout'
frames 60 10
[ "$(property NRestarts)" -ge 2 ] || fail "$(property NRestarts) restarts by systemd, 2 expected"
