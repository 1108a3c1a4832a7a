# shellcheck shell=sh
# Starts udevd, so that the guest has /dev/v4l/by-path and libcamera finds cameras. Sourced in the
# guest.
/lib/systemd/systemd-udevd --daemon
udevadm trigger --subsystem-match=video4linux --subsystem-match=media --action=add
udevadm settle
