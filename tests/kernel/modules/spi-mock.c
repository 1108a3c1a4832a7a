// SPDX-License-Identifier: GPL-2.0
/*
 * spi-mock: an SPI controller without hardware, with one spidev child, /dev/spidev<bus>.0. What is
 * sent is recorded; MISO is looped back from MOSI.
 *
 * debugfs spi_mock/
 *   log       every transfer as struct record, then its bytes; writing anything empties it.
 *             flags bit 0: the first transfer of its message
 *   fail      the errno (positive) that transfers return from now on; 0 = none
 *   realtime  1: a transfer takes its time on the wire, len * 8 / speed
 *   clock_percent    the clock's true rate of what is asked for; the log has what was asked for
 *   clock_transfers  how many transfers that holds for before it is 100 again; 0 = for good
 */
#include <linux/debugfs.h>
#include <linux/delay.h>
#include <linux/ktime.h>
#include <linux/math64.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/platform_device.h>
#include <linux/spi/spi.h>
#include <linux/uaccess.h>
#include <linux/vmalloc.h>

static int bus;
module_param(bus, int, 0444);
static uint max_hz = 125000000;
module_param(max_hz, uint, 0444);
static char *child = "dh2228fv"; /* an id in spidev's own table */
module_param(child, charp, 0444);

#define LOG_BYTES (4 << 20) /* once full, nothing more is recorded */

struct record {
	u64 start_ns;
	u32 speed_hz, len;
	u8 mode, bits, cs_change, flags;
	u32 delay_us;
} __packed;

static struct platform_device *parent;
static struct spi_controller *controller;
static struct dentry *folder;
static u8 *log;
static size_t log_used;
static DEFINE_MUTEX(log_lock);
static u32 fail;
static bool realtime;
static u32 clock_percent = 100, clock_transfers;

static void record_transfer(struct spi_device *device, struct spi_transfer *transfer)
{
	struct record record = {
		.start_ns = ktime_get_ns(),
		.speed_hz = transfer->speed_hz,
		.len = transfer->len,
		.mode = device->mode,
		.bits = transfer->bits_per_word,
		.cs_change = transfer->cs_change,
		.delay_us = transfer->delay.value,
		.flags = list_is_first(&transfer->transfer_list,
				       &controller->cur_msg->transfers),
	};

	mutex_lock(&log_lock);
	if (transfer->tx_buf && log_used + sizeof(record) + transfer->len <= LOG_BYTES) {
		memcpy(log + log_used, &record, sizeof(record));
		memcpy(log + log_used + sizeof(record), transfer->tx_buf, transfer->len);
		log_used += sizeof(record) + transfer->len;
	}
	mutex_unlock(&log_lock);
}

static int transfer_one(struct spi_controller *c, struct spi_device *device,
			struct spi_transfer *transfer)
{
	if (fail)
		return -(int)fail;
	record_transfer(device, transfer);
	if (transfer->rx_buf && transfer->tx_buf)
		memcpy(transfer->rx_buf, transfer->tx_buf, transfer->len);
	else if (transfer->rx_buf)
		memset(transfer->rx_buf, 0, transfer->len);
	if (realtime && transfer->speed_hz) {
		/* fsleep() may take twice as long, and the time is what a test measures */
		u64 us = div64_u64((u64)transfer->len * 8 * 1000000 * 100,
				   (u64)transfer->speed_hz * max(clock_percent, 1U));

		usleep_range(us, us + us / 128 + 1);
	}
	if (clock_transfers && --clock_transfers == 0)
		clock_percent = 100;
	return 0; /* finished */
}

static ssize_t log_read(struct file *f, char __user *to, size_t n, loff_t *position)
{
	ssize_t result;

	mutex_lock(&log_lock);
	result = simple_read_from_buffer(to, n, position, log, log_used);
	mutex_unlock(&log_lock);
	return result;
}

static ssize_t log_write(struct file *f, const char __user *from, size_t n, loff_t *position)
{
	mutex_lock(&log_lock);
	log_used = 0;
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
	struct spi_board_info info = { .max_speed_hz = max_hz, .mode = SPI_MODE_0 };
	int error = -ENOMEM;

	log = vmalloc(LOG_BYTES);
	if (!log)
		return -ENOMEM;
	parent = platform_device_register_simple("spi-mock", -1, NULL, 0);
	if (IS_ERR(parent)) {
		error = PTR_ERR(parent);
		goto free_log;
	}
	controller = spi_alloc_master(&parent->dev, 0);
	if (!controller)
		goto unregister_parent;
	controller->bus_num = bus;
	controller->num_chipselect = 1;
	controller->mode_bits = SPI_CPHA | SPI_CPOL | SPI_CS_HIGH | SPI_LSB_FIRST | SPI_NO_CS;
	controller->bits_per_word_mask = SPI_BPW_MASK(8);
	controller->max_speed_hz = max_hz;
	controller->transfer_one = transfer_one;
	error = spi_register_controller(controller);
	if (error) {
		spi_controller_put(controller);
		goto unregister_parent;
	}
	strscpy(info.modalias, child, sizeof(info.modalias));
	if (!spi_new_device(controller, &info)) {
		error = -ENODEV;
		spi_unregister_controller(controller);
		goto unregister_parent;
	}
	folder = debugfs_create_dir("spi_mock", NULL);
	debugfs_create_file("log", 0600, folder, NULL, &log_operations);
	debugfs_create_u32("fail", 0600, folder, &fail);
	debugfs_create_bool("realtime", 0600, folder, &realtime);
	debugfs_create_u32("clock_percent", 0600, folder, &clock_percent);
	debugfs_create_u32("clock_transfers", 0600, folder, &clock_transfers);
	return 0;

unregister_parent:
	platform_device_unregister(parent);
free_log:
	vfree(log);
	return error;
}

static void __exit mock_exit(void)
{
	debugfs_remove_recursive(folder);
	spi_unregister_controller(controller);
	platform_device_unregister(parent);
	vfree(log);
}

module_init(mock_init);
module_exit(mock_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("an SPI controller that records");
