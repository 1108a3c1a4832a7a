#!/usr/bin/env bash
# A real avahi-daemon on a bus and in a network namespace in which only loopback is up: dtactd
# announces itself there and dtactctl finds it. discovery_test.sh DTACTD DTACTCTL
set -euo pipefail
daemon=$1 ctl=$2

if [[ ${3-} != inside ]]; then
  for program in avahi-daemon dbus-daemon ip unshare; do
    command -v "$program" >/dev/null || PATH=$PATH:/usr/sbin:/sbin command -v "$program" >/dev/null ||
      { echo "skipped: $program is not installed"; exit 77; }
  done
  unshare --net --mount --map-root-user true 2>/dev/null || { echo "skipped: no namespaces can be made here"; exit 77; }
  exec unshare --net --mount --map-root-user "$0" "$daemon" "$ctl" inside
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
! says alone announced || fail 'announced from loopback'
! says quiet announced || fail 'announced against its configuration'

# A daemon that ends disappears.
kill "${jobs[1]}"
gone() { "$ctl" find --json >"$folder/find.log"; (($(wc -l <"$folder/find.log") == 1)); }
within 30 gone
echo 'announced, found, gone'
