# shellcheck shell=bash disable=SC2154
# Two instances of the template beside the first service, each with its own file, port and state.
instance left 7401
instance right 7402
for port in 7401 7402; do frames 30 10 --port $port; done
of_left() { journalctl --no-pager -b -o cat DTACT_SENSOR="$(uname -n)-left" | grep listening; }
within 60 of_left
dtactctl --port 7401 calibration upload /job/calibrations/new --name mine
expect mine dtactctl --port 7401 calibration list
dtactctl --port 7402 calibration list | grep mine && fail "the sensors share their state"
ls -d /var/lib/dtactd/left /var/lib/dtactd/right /run/dtactd/*/*.sock
systemctl stop dtactd@right
within 120 serving
within 120 dtactctl --port 7401 status > /dev/null
systemctl disable -q --now dtactd@left dtactd@right
rm /etc/dtactd/{left,right}.toml
