#!/bin/sh
# Runs in the guest: udevd with config/udev's rules gives real spidev, GPIO and LED nodes to their groups,
# and a user of those groups, and no other, may open them. udev.sh SOURCE_FOLDER
set -eu
source=$1
[ -x /lib/systemd/systemd-udevd ] || { echo "skipped: udev is not installed here" >&2; exit 77; }
mkdir -p /etc/sysusers.d /etc/udev/rules.d
cp "$source/systemd/dtactd.sysusers" /etc/sysusers.d/dtactd.conf
cp "$source/config/udev/60-dtactd.rules" /etc/udev/rules.d/
systemd-sysusers
/lib/systemd/systemd-udevd --daemon
insmod "$KERNEL_CACHE/modules/spi-mock.ko"
insmod "$KERNEL_CACHE/modules/ws2812-pio-mock.ko"
sim=/sys/kernel/config/gpio-sim/udev
mkdir -p $sim/bank0
echo 4 > $sim/bank0/num_lines
echo 1 > $sim/live
udevadm trigger
udevadm settle --timeout=30

failed=0
expect() { # expect NODE GROUP
  found=$(stat -c '%G %a' "$1")
  echo "$1: $found"
  [ "$found" = "$2 660" ] || { echo "FAILED: $1 is \"$found\", not \"$2 660\""; failed=1; }
  setpriv --reuid=nobody --regid=nogroup --groups="$2" sh -c "exec 3<> $1" \
    || { echo "FAILED: a member of $2 cannot open $1"; failed=1; }
  if setpriv --reuid=nobody --regid=nogroup --clear-groups sh -c "exec 3<> $1" 2> /dev/null; then
    echo "FAILED: anybody can open $1"
    failed=1
  fi
}
expect /dev/spidev0.0 spi
expect "/dev/$(cat $sim/bank0/chip_name)" gpio
expect /dev/leds0 gpio
exit $failed
