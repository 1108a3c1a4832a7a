# shellcheck shell=bash disable=SC2154
# The wall clock jumps a day ahead, two back, and then to the true time, while a client watches.
before=$(pid)
dtactctl watch --summary --seconds 15 > /tmp/watch 2>&1 &
watch=$!
sleep 3
for step in '+1 day' '-2 days' '+1 day'; do
  date -s "$(date -d "$step" '+%F %T')" > /dev/null
  sleep 3
done
wait "$watch" || fail "the client's stream ended: $(cat /tmp/watch)"
tail -n 1 /tmp/watch
frames 60 10
is_still "$before"
