# shellcheck shell=bash disable=SC2154
# The camera's driver does not return from a call: the watchdog ends the daemon, and systemd restarts it.
{
  cat /usr/share/dtactd/scenes/nothing.toml
  printf '\n[[fault]]\nkind = "hang"\nframe = 600\nframes = 36000\n'
} > /etc/dtactd/hung.toml
sed -i 's|^scene = .*|scene = "/etc/dtactd/hung.toml"|' "$config"
systemctl restart dtactd
within 120 serving
before=$(pid)
within 180 other_pid "$before"
within 30 journal_says 'Watchdog timeout'
within 120 serving
rm /etc/dtactd/hung.toml
