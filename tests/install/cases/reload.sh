# shellcheck shell=bash disable=SC2154
# A good configuration is applied without a restart and without a client noticing; settings that need a restart
# are named.
before=$(pid)
dtactctl watch --summary --seconds 20 > /tmp/watch 2>&1 &
watch=$!
sed -i 's/^max_clients = 32 /max_clients = 1 /; s/^brightness = 255/brightness = 200/' "$config"
systemctl reload dtactd
within 60 journal_says max_clients
within 60 bash -c 'systemctl status --no-pager dtactd | grep "needs a restart: ring.brightness"'
# The watching client is the one allowed client.
expect max_clients dtactctl status
is_still "$before"
wait "$watch" || fail "the client's stream ended: $(cat /tmp/watch)"
tail -n 1 /tmp/watch
