#!/bin/sh
# What this board is, what is wrong with it, and how dtactd runs on it for 20 seconds or SECONDS:
#
#   config/boards/try-board.sh config/boards/raspberry-pi-5-usb-pio.toml >report.txt
#
# Read the file, then attach it to a new issue in the project's issue tracker. It holds neither names
# of users and hosts nor serial numbers.
set -u
config=${1:?"usage: $0 CONFIG.toml [SECONDS]"} seconds=${2:-20} folder=$(mktemp -d) && : >"$folder/log"
try() {
  dtactd --config "$config" --doctor --report
  dtactd --config "$config" --set state_dir="$folder" --set net.address=127.0.0.1 --set net.port=0 >"$folder/log" 2>&1 &
  while port=$(sed -n 's/.*listening on .*:\([0-9]*\)$/\1/p' "$folder/log") && [ -z "$port" ] && kill -0 $!; do sleep 0.2; done
  [ -n "$port" ] && dtactctl --port "$port" watch --seconds "$seconds" && dtactctl --port "$port" status
  kill $!
  wait $!
  cat "$folder/log"
}
try 2>&1 | sed -E "s|$HOME|~|g; s/serial:[^ ,]+/serial:…/g; s|by-id/[^ ,]+|by-id/…|g"
rm -r "$folder"
