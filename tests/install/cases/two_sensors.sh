# shellcheck shell=bash disable=SC2154
# Two instances of the template beside the first service, each with its own file, port and state.
port=7401
for name in left right; do
  sed "s/^port = 7377 .*/port = $port/" "$config" > "/etc/dtactd/$name.toml"
  port=$((port + 1))
  systemctl enable -q --now "dtactd@$name"
done
for port in 7401 7402; do
  within 120 dtactctl --port $port status
  frames 30 10 --port $port
done
dtactctl --port 7401 calibration upload /job/calibrations/new --name mine
expect mine dtactctl --port 7401 calibration list
dtactctl --port 7402 calibration list | grep mine && fail "the sensors share their state"
ls -d /var/lib/dtactd/left /var/lib/dtactd/right /run/dtactd/*/*.sock
systemctl stop dtactd@right
within 120 serving
within 120 dtactctl --port 7401 status > /dev/null
systemctl disable -q --now dtactd@left dtactd@right
