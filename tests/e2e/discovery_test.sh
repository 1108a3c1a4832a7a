#!/usr/bin/env bash
# A real avahi-daemon on a bus and in a network namespace in which only loopback is up: dtactd
# announces itself there and the clients find it. discovery_test.sh DTACTD DTACTCTL DTACT_DDS DTACT_WEB
set -euo pipefail
daemon=$1 ctl=$2 dds=$3 web=$4

if [[ ${5-} != inside ]]; then
  for program in avahi-daemon dbus-daemon ip unshare; do
    command -v "$program" >/dev/null || PATH=$PATH:/usr/sbin:/sbin command -v "$program" >/dev/null ||
      { echo "skipped: $program is not installed"; exit 77; }
  done
  unshare --net --mount --map-root-user true 2>/dev/null || { echo "skipped: no namespaces can be made here"; exit 77; }
  exec unshare --net --mount --map-root-user "$0" "$daemon" "$ctl" "$dds" "$web" inside
fi

PATH=$PATH:/usr/sbin:/sbin
folder=$(mktemp -d)
jobs=()
finish() {
  local status=$?
  ((status == 0)) || tail -n 30 "$folder"/*.log
  for job in "${jobs[@]}"; do kill "$job" 2>/dev/null || true; done
  wait
  rm -rf "$folder"
}
trap finish EXIT

fail() { echo "FAILED: $1"; exit 1; }
# within SECONDS COMMAND...: repeats the command until it succeeds.
within() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    ((SECONDS < end)) || fail "$*"
    sleep 0.2
  done
}
says() { grep -sqF -- "$2" "$folder/$1.log"; }

start_avahi() {
  avahi-daemon -f "$folder/avahi.conf" --no-drop-root --no-chroot --no-rlimits >"$folder/avahi.log" 2>&1 &
  avahi=$!
  jobs+=("$avahi")
}
# start_daemon NAME SETTING...: starts another dtactd.
start_daemon() {
  local name=$1 settings=()
  shift
  for setting in "$@"; do settings+=(--set "$setting"); done
  "$daemon" --set camera.backend=null --set ring.backend=null --set net.port=0 --set net.listen_insecure=true \
    --set "state_dir=$folder/$name" "${settings[@]}" >"$folder/$name.log" 2>&1 &
  jobs+=($!)
  within 30 says "$name" 'listening on'
}

mount -t tmpfs none /run
# avahi-daemon gives its folder in /run to its own user, and this namespace has only one user.
for file in passwd group; do
  sed -E 's/^avahi:x:[0-9]+:([0-9]+:)?/avahi:x:0:\1/; s/^avahi:x:0:[0-9]+:/avahi:x:0:0:/' "/etc/$file" >"$folder/$file"
  mount --bind "$folder/$file" "/etc/$file"
done
ip link set lo up
ip address add 192.0.2.7/32 dev lo
cat >"$folder/avahi.conf" <<'TEXT'
[server]
host-name=gripper
use-ipv6=no
[publish]
publish-workstation=no
TEXT
export DBUS_SYSTEM_BUS_ADDRESS=unix:path=$folder/bus
dbus-daemon --session --nofork --address="$DBUS_SYSTEM_BUS_ADDRESS" >"$folder/bus.log" 2>&1 &
jobs+=($!)
within 10 test -S "$folder/bus"

# Without avahi-daemon: the daemon runs without announcing, the client says what is missing.
start_daemon first net.address=192.0.2.7
within 30 says first 'not announced until avahi-daemon runs'
! "$ctl" find >"$folder/find.log" 2>&1 || fail 'found something without avahi-daemon'
says find 'no avahi-daemon to ask' || fail 'no word of avahi-daemon'

# An avahi-daemon that comes later is seen, and so is one that restarts.
start_avahi
within 60 says first 'announced as "'
within 60 "$ctl" find --json >"$folder/find.log"
port=$(sed -n 's/.*listening on 192\.0\.2\.7:\([0-9]*\).*/\1/p' "$folder/first.log")
for part in '"host":"gripper.local"' '"address":"192.0.2.7"' "\"port\":$port" '"version":"0.' '"tls":false' '"token":false'; do
  says find "$part" || fail "find does not say $part"
done
kill "$avahi"
wait "$avahi" || true
start_avahi
within 60 "$ctl" find >"$folder/find.log"
says find "--host 192.0.2.7 --port $port" || fail 'not found again'

# Two daemons of one name coexist; one on loopback only, or with announcing off, is not announced.
start_daemon second net.address=0.0.0.0
within 60 says second '#2" (_dtact._tcp'
start_daemon alone
start_daemon quiet net.address=192.0.2.7 net.announce=false
"$ctl" find --json >"$folder/find.log"
(($(wc -l <"$folder/find.log") == 2)) || fail 'not two were found'
# They are asked together; none serves, as it has no camera.
! "$ctl" fleet status >"$folder/fleet.log" 2>&1 || fail 'a fleet without cameras is well'
says fleet 'dtactctl: 2 of 2 not well: gripper' || fail 'not two were asked'
! says fleet 'not answer' || fail 'one did not answer'
! says alone announced || fail 'announced from loopback'
! says quiet announced || fail 'announced against its configuration'

# On the ROS 2 graph two daemons of one name are two, and one that is both named and found is one.
start_daemon third net.address=192.0.2.7 net.name=left
"$dds" --find --daemon "mine=192.0.2.7:$port" --domain 20 >"$folder/dds.log" 2>&1 &
jobs+=($!)
within 30 says dds "gripper_left is there: dtactd"
three() { (($(grep -c "^[[:alnum:]_]* is there" "$folder/dds.log") == 3)); }
within 30 three
says dds 'mine is there' || fail 'the one that was named is not there'

# The page has them by the same names.
"$web" --find --daemon "mine=192.0.2.7:$port" --listen-port 0 >"$folder/web.log" 2>&1 &
jobs+=($!)
within 30 says web 'the daemon of gripper_left is there: dtactd'
(($(grep -c '^found gripper_' "$folder/web.log") == 2)) || fail 'the page has not two besides the one that was named'
three || fail 'the graph has more than three'

# A daemon that ends disappears.
kill "${jobs[1]}"
gone() { "$ctl" find --json >"$folder/find.log"; (($(wc -l <"$folder/find.log") == 2)); }
within 30 gone

# A daemon whose machine gets another address is reached there when its connection is lost.
ip address add 192.0.2.8/32 dev lo
ip address delete 192.0.2.7/32 dev lo
within 60 says web 'is at 192.0.2.8:'
within 60 says dds 'is at 192.0.2.8:'
back() { (($(grep -c "^$1" "$folder/$2.log") >= $3)); }
within 60 back 'gripper_[[:alnum:]_]* is there' dds 3
within 60 back 'the daemon of gripper_[[:alnum:]_]* is there' web 3
echo 'announced, found, gone, moved'
