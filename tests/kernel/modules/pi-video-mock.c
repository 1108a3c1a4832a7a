// SPDX-License-Identifier: GPL-2.0
/*
 * pi-video-mock: the video nodes that a Raspberry Pi 4 has without any camera.
 *
 * Names, numbers and capabilities are those of bcm2835-v4l2-isp.c and bcm2835-v4l2-codec.c below
 * drivers/staging/vc04_services in raspberrypi/linux (rpi-6.1.y): two scalers, each with a node that
 * takes images, two that deliver them and one for statistics, and the codec's five. A scaler's capture
 * nodes offer formats at every size from 64 to 16384 and have no VIDIOC_ENUMINPUT. Nothing streams.
 */
#include <linux/module.h>
#include <linux/platform_device.h>
#include <media/v4l2-dev.h>
#include <media/v4l2-device.h>
#include <media/v4l2-fh.h>
#include <media/v4l2-ioctl.h>

#define ISP "bcm2835-isp"
#define CODEC "bcm2835-codec"

struct mock_node {
	const char *driver;
	const char *card;
	int number;
	u32 caps;
	int direction;
	struct video_device device;
};

#define ISP_NODE(n, what, dir) \
	{ .driver = ISP, .card = ISP, .number = n, .caps = what | V4L2_CAP_STREAMING, .direction = dir }
#define ISP_NODES(base) \
	ISP_NODE(base, V4L2_CAP_VIDEO_OUTPUT, VFL_DIR_TX), \
	ISP_NODE(base + 1, V4L2_CAP_VIDEO_CAPTURE, VFL_DIR_RX), \
	ISP_NODE(base + 2, V4L2_CAP_VIDEO_CAPTURE, VFL_DIR_RX), \
	ISP_NODE(base + 3, V4L2_CAP_META_CAPTURE, VFL_DIR_RX)
#define CODEC_NODE(n, role) \
	{ .driver = CODEC, .card = CODEC "-" role, .number = n, \
	  .caps = V4L2_CAP_VIDEO_M2M_MPLANE | V4L2_CAP_STREAMING, .direction = VFL_DIR_M2M }

static struct mock_node nodes[] = {
	ISP_NODES(13), ISP_NODES(20),
	CODEC_NODE(10, "decode"), CODEC_NODE(11, "encode"), CODEC_NODE(12, "isp"),
	CODEC_NODE(18, "image_fx"), CODEC_NODE(31, "encode_image"),
};
static const u32 formats[] = { V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_RGB24 };

static struct platform_device *parents[2];
static struct v4l2_device devices[2];

static struct mock_node *node_of(struct file *file)
{
	return container_of(video_devdata(file), struct mock_node, device);
}

static int querycap(struct file *file, void *fh, struct v4l2_capability *capability)
{
	const struct mock_node *node = node_of(file);

	strscpy(capability->driver, node->driver, sizeof(capability->driver));
	strscpy(capability->card, node->card, sizeof(capability->card));
	snprintf(capability->bus_info, sizeof(capability->bus_info), "platform:%s", node->driver);
	return 0;
}

static int enum_fmt(struct file *file, void *fh, struct v4l2_fmtdesc *format)
{
	if (format->index >= ARRAY_SIZE(formats))
		return -EINVAL;
	format->pixelformat = formats[format->index];
	return 0;
}

/* The core lists formats only where there is one to get. */
static int g_fmt(struct file *file, void *fh, struct v4l2_format *format)
{
	format->fmt.pix.width = 1280;
	format->fmt.pix.height = 1280;
	format->fmt.pix.pixelformat = formats[0];
	format->fmt.pix.field = V4L2_FIELD_NONE;
	return 0;
}

static int enum_framesizes(struct file *file, void *fh, struct v4l2_frmsizeenum *size)
{
	if (size->index)
		return -EINVAL;
	size->type = V4L2_FRMSIZE_TYPE_STEPWISE;
	size->stepwise = (struct v4l2_frmsize_stepwise){ 64, 16384, 2, 64, 16384, 2 };
	return 0;
}

static const struct v4l2_ioctl_ops ioctls = {
	.vidioc_querycap = querycap,
	.vidioc_enum_fmt_vid_cap = enum_fmt,
	.vidioc_g_fmt_vid_cap = g_fmt,
	.vidioc_enum_framesizes = enum_framesizes,
};
static const struct v4l2_file_operations operations = {
	.owner = THIS_MODULE,
	.open = v4l2_fh_open,
	.release = v4l2_fh_release,
	.unlocked_ioctl = video_ioctl2,
};

static void undo(unsigned int registered)
{
	unsigned int i;

	for (i = 0; i < registered; i++)
		video_unregister_device(&nodes[i].device);
	for (i = 0; i < ARRAY_SIZE(parents); i++) {
		if (IS_ERR_OR_NULL(parents[i]))
			continue;
		if (devices[i].dev)
			v4l2_device_unregister(&devices[i]);
		platform_device_unregister(parents[i]);
	}
}

static int __init mock_init(void)
{
	static const char *const drivers[] = { ISP, CODEC };
	unsigned int i;
	int error;

	for (i = 0; i < ARRAY_SIZE(parents); i++) {
		strscpy(devices[i].name, drivers[i], sizeof(devices[i].name));
		parents[i] = platform_device_register_simple(drivers[i], -1, NULL, 0);
		error = PTR_ERR_OR_ZERO(parents[i]);
		if (!error)
			error = v4l2_device_register(&parents[i]->dev, &devices[i]);
		if (error) {
			undo(0);
			return error;
		}
	}
	for (i = 0; i < ARRAY_SIZE(nodes); i++) {
		struct video_device *device = &nodes[i].device;

		strscpy(device->name, nodes[i].card, sizeof(device->name));
		device->v4l2_dev = &devices[strcmp(nodes[i].driver, ISP) != 0];
		device->fops = &operations;
		device->ioctl_ops = &ioctls;
		device->device_caps = nodes[i].caps;
		device->vfl_dir = nodes[i].direction;
		device->release = video_device_release_empty;
		error = video_register_device(device, VFL_TYPE_VIDEO, nodes[i].number);
		if (error) {
			undo(i);
			return error;
		}
	}
	return 0;
}

static void __exit mock_exit(void)
{
	undo(ARRAY_SIZE(nodes));
}

module_init(mock_init);
module_exit(mock_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("the scalers' and the codec's video nodes of a Raspberry Pi 4");
