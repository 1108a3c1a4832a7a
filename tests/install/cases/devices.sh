# shellcheck shell=bash disable=SC2154
# The hardened unit's process opens a camera, an SPI device and a GPIO line of real kernel drivers through the
# groups that udev's rules assign; the line's bias reaches the chip, and the error for a line that is in use
# names the line's holder, with the libgpiod of this Debian.
for module in font cfbcopyarea cfbfillrect cfbimgblt v4l2-tpg videobuf2-dma-contig; do
  insmod "/job/modules/$module.ko"
done
insmod /job/modules/vivid.ko n_devs=1 num_inputs=1 input_types=0 vid_cap_nr=8 node_types=1
insmod /job/modules/spi-mock.ko
mount -t configfs configfs /sys/kernel/config
sim=/sys/kernel/config/gpio-sim/power
mkdir -p $sim/bank0
echo 4 > $sim/bank0/num_lines
mkdir -p $sim/bank0/line2/hog
echo lcd-reset > $sim/bank0/line2/hog/name
echo output-low > $sim/bank0/line2/hog/direction
echo 1 > $sim/live
udevadm trigger --subsystem-match=video4linux --subsystem-match=spidev --subsystem-match=gpio --action=add
udevadm settle
chip=$(cat $sim/bank0/chip_name)
stat -c '%n %U:%G %a' /dev/video8 /dev/spidev0.0 "/dev/$chip"
cat > /etc/dtactd/devices.toml << T
[camera]
backend = "v4l2"
width = 320
height = 180
[camera.v4l2]
device = "bus:platform:vivid-000"
[ring]
backend = "ws2812_spi"
[ring.ws2812]
spi_check_rate = false # the mock's transfers take no time
[ring.ws2812.power]
chip = "/dev/$chip"
line = 1
bias = "pull-up"
[net]
port = 7410
T
systemctl start dtactd@devices || { journalctl -b --no-pager -o cat -u dtactd@devices | tail; fail "does not start"; }
within 60 dtactctl --port 7410 status
within 60 bash -c 'dtactctl --port 7410 status | grep -q streaming'
dtactctl --port 7410 status | head -n 12
open=$(ls -l "/proc/$(pid dtactd@devices)/fd")
for node in /dev/video8 /dev/spidev0.0 gpio; do
  grep -qF "$node" <<< "$open" || fail "$node is not open: $open"
done
line=/sys/devices/platform/$(cat $sim/dev_name)/$chip/sim_gpio1
[ "$(cat "$line/value")" = 1 ] || fail "the ring has no power"
[ "$(cat "$line/pull")" = pull-up ] || fail "the line's bias is $(cat "$line/pull")"
frames 30 10 --port 7410
sed -i 's/^line = 1$/line = 2/' /etc/dtactd/devices.toml
systemctl restart dtactd@devices
within 60 bash -c 'dtactctl --port 7410 status | grep -qF "in use by \"lcd-reset\""'
frames 30 10 --port 7410
systemctl stop dtactd@devices
rm /etc/dtactd/devices.toml
