# shellcheck shell=bash
# Common parts of the cases; the driver puts it before each of them.
set -euo pipefail
export LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive HOME=/root
config=/etc/dtactd/dtactd.toml

say() { echo "[$(date +%T)] $*"; }
fail() {
  say "FAILED: $*"
  exit 1
}
# expect TEXT COMMAND...: the command's output contains the text, whatever its status.
expect() {
  local text=$1 output
  shift
  output=$("$@" 2>&1) || true
  grep -qF -- "$text" <<< "$output" || fail "no \"$text\" in what '$*' printed:"$'\n'"$output"
}
# within SECONDS COMMAND...: repeats the command until it succeeds. Generous, for the host may be busy.
within() {
  local end=$((SECONDS + $1))
  shift
  until "$@" > /tmp/within 2>&1; do
    ((SECONDS < end)) || fail "never came true: $*"$'\n'"$(cat /tmp/within; systemctl status --no-pager dtactd)"
    sleep 0.3
  done
}
# instance NAME PORT: a configuration of its own for dtactd@NAME, which is enabled and serves.
instance() {
  sed "s/^port = 7377 .*/port = $2/" "$config" > "/etc/dtactd/$1.toml"
  systemctl enable -q --now "dtactd@$1"
  within 300 dtactctl --port "$2" status
}
# export_calibration: exports the one in use to /tmp/export. same NAME: it equals /job/calibrations/NAME, byte for
# byte.
export_calibration() {
  rm -rf /tmp/export
  dtactctl calibration download -o /tmp/export
}
same() {
  cmp -s "/job/calibrations/$1/calibration.toml" /tmp/export/calibration.toml \
    && cmp -s "/job/calibrations/$1/reference.png" /tmp/export/reference.png
}
property() { systemctl show --value -p "$1" "${2:-dtactd}"; }
pid() { property MainPID "${1:-dtactd}"; }
other_pid() { [ "$(pid dtactd)" != "$1" ] && [ "$(pid dtactd)" != 0 ]; }
journal_says() { journalctl --no-pager -o cat -b -u dtactd --since "$since" | grep -F -- "$*"; }
serving() { systemctl is-active dtactd && dtactctl "$@" status; }
is_still() { [ "$(pid dtactd)" = "$1" ] || fail "the daemon was started anew: $(systemctl status --no-pager dtactd)"; }

# frames LEAST SECONDS [OPTION...]: a client gets at least LEAST frames, and the rate is printed. In an emulated
# guest a sixth of them, like its sensor's rate.
frames() {
  local least=$1 seconds=$2 summary count
  shift 2
  [ -z "${emulated-}" ] || least=$((least / 6))
  summary=$(dtactctl "$@" watch --summary --seconds "$seconds" 2>&1) || fail "watch: $summary"
  summary=$(tail -n 1 <<< "$summary")
  say "$summary"
  count=$(sed -n 's/^watched .* s: \([0-9]*\) frames.*/\1/p' <<< "$summary")
  ((count >= least)) || fail "$count frames in $seconds s, at least $least were expected"
}

apt_get() { apt-get -y -qq --no-install-recommends "$@" > /tmp/apt 2>&1 || fail "apt-get $*: $(cat /tmp/apt)"; }

# Files in the file system, without those that change by themselves; a service that starts again has another
# private folder.
files() {
  find / -xdev \( -path /proc -o -path /sys -o -path /run -o -path /tmp -o -path /job -o -path /dev \
    -o -path /var/cache -o -path /var/log -o -path /var/lib/apt -o -path /var/lib/dpkg \) -prune -o -print \
    | sed -E 's|(/systemd-private-[^/]*\.service-)[A-Za-z0-9]{6}|\1|' | sort
}
still_scene() {
  sed -i 's|^scene = ""|scene = "/usr/share/dtactd/scenes/nothing.toml"|' "$config"
  [ -z "${emulated-}" ] || sed -i 's/^fps = 60.0 /fps = 10.0 /' "$config"
}
# Every case but the first and the last begins with it: the daemon runs, whatever state the case before left.
begin_case() {
  cp /tmp/still.toml "$config"
  systemctl restart dtactd || true
  within 120 serving
  since=$(date '+%F %T')
}
