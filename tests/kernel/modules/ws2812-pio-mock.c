// SPDX-License-Identifier: GPL-2.0
/*
 * ws2812-pio-mock: a Raspberry Pi 5's LED driver as programs see it (raspberrypi/linux,
 * drivers/misc/ws2812-pio-rp1.c), without PIO and LEDs: what would light them is recorded. Written
 * anew after that driver's functions, which are named below. One chain, /dev/leds0.
 *
 * Parameter num_leds counts from the next probe on: bind and unbind through
 * /sys/bus/platform/drivers/ws2812-pio-rp1 do what loading and removing the overlay does.
 *
 * debugfs ws2812_pio_mock/
 *   writes  a line for each write: offset, bytes, the first byte (hexadecimal)
 *   sent    a line for each time the chain was sent: its colours as rrggbb
 *           writing anything to either empties both
 *   late    writes through a file that was open when the driver was removed: in the driver, use of
 *           freed memory
 */
#include <linux/cdev.h>
#include <linux/debugfs.h>
#include <linux/delay.h>
#include <linux/fs.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/platform_device.h>
#include <linux/slab.h>
#include <linux/uaccess.h>
#include <linux/workqueue.h>

#define NAME "ws2812-pio-rp1" /* of driver and class: udev's rules see the class */
#define PIXEL_BYTES 4
#define LED_US 30 /* 24 bits at 800 kHz */
#define RESET_US 50
#define LOG_BYTES (1 << 18) /* once full, nothing more is recorded */

static uint num_leds = 8; /* the overlay's rpi,num-leds */
module_param(num_leds, uint, 0644);

struct log {
	char text[LOG_BYTES];
	size_t used;
};
static struct log writes, sent;
static DEFINE_MUTEX(log_lock);
static u32 late;

static struct {
	bool bound;
	u8 *pixbuf, *buffer;
	u32 leds, pixbuf_size, write_end;
	u8 brightness;
	struct delayed_work work;
} state;
static struct platform_device *device;
static struct class *leds_class;
static struct cdev *cdev;
static dev_t number;
static struct dentry *folder;

/* ws2812_apply_gamma(): 0 leaves the colour. The table's place is taken by a square. */
static u8 apply_gamma(u8 value)
{
	uint bright;

	if (!value || !state.brightness)
		return value;
	bright = value * state.brightness / 255;
	return bright * bright / 255;
}

/* ws2812_update_leds(): the transfer and the pause after it. The PIO takes 24 of a LED's 32 bits. */
static void update_leds(void)
{
	u32 i;

	usleep_range(LED_US * state.leds, LED_US * state.leds + 10);
	mutex_lock(&log_lock);
	if (sent.used + 7 * state.leds + 1 < LOG_BYTES) {
		for (i = 0; i < state.leds; i++) {
			const u8 *led = state.buffer + PIXEL_BYTES * i;

			sent.used += sprintf(sent.text + sent.used, "%02x%02x%02x%c", led[0],
					     led[1], led[2], i + 1 < state.leds ? ' ' : '\n');
		}
	}
	mutex_unlock(&log_lock);
	usleep_range(RESET_US, RESET_US + 100);
}

/* ws2812_pio_rp1_deferred_work(): what the last write did not reach is dark. */
static void deferred_work(struct work_struct *work)
{
	u32 i;

	if (state.write_end < state.pixbuf_size)
		memset(state.pixbuf + state.write_end, 0, state.pixbuf_size - state.write_end);
	for (i = 0; i < state.pixbuf_size; i++)
		state.buffer[i] = apply_gamma(state.pixbuf[i]);
	update_leds();
}

/*
 * ws2812_pio_rp1_write(): too much is refused, but what fits is sent; a single byte at 0 is the
 * brightness; a write that ends at the last LED is sent at once, another after HZ / 20, and work
 * that waits already is not brought forward.
 */
static ssize_t leds_write(struct file *file, const char __user *from, size_t count,
			  loff_t *position)
{
	loff_t at = *position;
	int error = 0;
	u8 first = 0;

	if (!state.bound) {
		late++;
		return -EIO;
	}
	if (at > state.pixbuf_size)
		return -EFBIG;
	if (count && get_user(first, from))
		return -EFAULT;
	mutex_lock(&log_lock);
	if (writes.used + 64 < LOG_BYTES)
		writes.used += sprintf(writes.text + writes.used, "%lld %zu %02x\n", at, count,
				       first);
	mutex_unlock(&log_lock);
	if (count > state.pixbuf_size) {
		error = -EFBIG;
		count = state.pixbuf_size;
	}
	if (at + count > state.pixbuf_size) {
		if (!error)
			error = -ENOSPC;
		count = state.pixbuf_size - at;
	}
	if (!at && count == 1) {
		state.brightness = first;
	} else {
		if (copy_from_user(state.pixbuf + at, from, count))
			return -EFAULT;
		at += count;
		state.write_end = at;
	}
	*position = at;
	schedule_delayed_work(&state.work, state.write_end == state.pixbuf_size ? 0 : HZ / 20);
	return error ? error : count;
}

static const struct file_operations leds_operations = {
	.owner = THIS_MODULE,
	.write = leds_write,
};

/* ws2812_pio_rp1_probe(): the buffer is not cleared, the LEDs are. */
static int probe(struct platform_device *d)
{
	struct device *node;
	int error;

	memset(&state, 0, sizeof(state));
	state.leds = num_leds;
	state.pixbuf_size = num_leds * PIXEL_BYTES;
	state.brightness = 255;
	state.pixbuf = devm_kmalloc(&d->dev, state.pixbuf_size, GFP_KERNEL);
	state.buffer = devm_kzalloc(&d->dev, state.pixbuf_size, GFP_KERNEL);
	if (!state.pixbuf || !state.buffer)
		return -ENOMEM;
	memset(state.pixbuf, 0x5A, state.pixbuf_size); /* whatever was in that memory */
	INIT_DELAYED_WORK(&state.work, deferred_work);
	cdev = cdev_alloc();
	if (!cdev)
		return -ENOMEM;
	cdev->owner = THIS_MODULE;
	cdev->ops = &leds_operations;
	error = cdev_add(cdev, number, 1);
	if (error) {
		kobject_put(&cdev->kobj);
		return error;
	}
	node = device_create(leds_class, NULL, number, NULL, "leds%d", 0);
	if (IS_ERR(node)) {
		cdev_del(cdev);
		return PTR_ERR(node);
	}
	update_leds();
	state.bound = true;
	return 0;
}

/* ws2812_pio_rp1_remove() */
static int remove(struct platform_device *d)
{
	state.bound = false;
	cancel_delayed_work_sync(&state.work);
	cdev_del(cdev);
	device_destroy(leds_class, number);
	return 0;
}

static struct platform_driver driver = {
	.driver = { .name = NAME },
	.probe = probe,
	.remove = remove,
};

static ssize_t log_read(struct file *f, char __user *to, size_t n, loff_t *position)
{
	struct log *log = file_inode(f)->i_private;
	ssize_t result;

	mutex_lock(&log_lock);
	result = simple_read_from_buffer(to, n, position, log->text, log->used);
	mutex_unlock(&log_lock);
	return result;
}

static ssize_t log_write(struct file *f, const char __user *from, size_t n, loff_t *position)
{
	mutex_lock(&log_lock);
	writes.used = 0;
	sent.used = 0;
	mutex_unlock(&log_lock);
	return n;
}

static const struct file_operations log_operations = {
	.owner = THIS_MODULE,
	.read = log_read,
	.write = log_write,
	.llseek = default_llseek,
};

static int __init mock_init(void)
{
	int error = alloc_chrdev_region(&number, 0, 1, NAME);

	if (error)
		return error;
	leds_class = class_create(THIS_MODULE, NAME);
	if (IS_ERR(leds_class)) {
		error = PTR_ERR(leds_class);
		goto free_number;
	}
	folder = debugfs_create_dir("ws2812_pio_mock", NULL);
	debugfs_create_file("writes", 0600, folder, &writes, &log_operations);
	debugfs_create_file("sent", 0600, folder, &sent, &log_operations);
	debugfs_create_u32("late", 0600, folder, &late);
	error = platform_driver_register(&driver);
	if (error)
		goto free_class;
	device = platform_device_register_simple(NAME, -1, NULL, 0);
	if (!IS_ERR(device))
		return 0;
	error = PTR_ERR(device);
	platform_driver_unregister(&driver);

free_class:
	debugfs_remove_recursive(folder);
	class_destroy(leds_class);
free_number:
	unregister_chrdev_region(number, 1);
	return error;
}

static void __exit mock_exit(void)
{
	platform_device_unregister(device);
	platform_driver_unregister(&driver);
	debugfs_remove_recursive(folder);
	class_destroy(leds_class);
	unregister_chrdev_region(number, 1);
}

module_init(mock_init);
module_exit(mock_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("WS2812 LEDs that record");
