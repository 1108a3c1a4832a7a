# shellcheck shell=bash disable=SC2154
# A configuration with an error: a reload is refused with the reason and disturbs nothing; a restart fails
# with the reason, and the daemon is there once the file is mended, without another command.
before=$(pid)
cp "$config" /tmp/good.toml
sed -i 's/^fps = .*/fps = "many"/' "$config"
systemctl reload dtactd && fail "a broken configuration was taken"
within 10 journal_says fps
is_still "$before"
frames 60 10
say "restart"
systemctl restart dtactd || true
within 60 journal_says 'Failed with result'
cp /tmp/good.toml "$config"
within 120 serving
journalctl --no-pager -o cat -b -u dtactd --since "$since" | grep -F fps | tail -n 1
