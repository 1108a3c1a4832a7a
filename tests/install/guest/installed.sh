# shellcheck shell=bash
# The packages, and the calibration "old" in use.
apt_get install /job/packages/*.deb
still_scene
systemctl restart dtactd
within 300 serving
dtactctl calibration upload /job/calibrations/old --name old
