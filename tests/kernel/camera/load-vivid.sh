# shellcheck shell=sh
# Loads vivid as /dev/video8 with one HDMI input; what it needs comes first. Sourced in the guest.
for module in font cfbcopyarea cfbfillrect cfbimgblt v4l2-tpg videobuf2-dma-contig; do
  insmod "$KERNEL_CACHE/modules/$module.ko"
done
insmod "$KERNEL_CACHE/modules/vivid.ko" n_devs=1 num_inputs=1 input_types=3 vid_cap_nr=8 node_types=1
