// SPDX-License-Identifier: GPL-2.0
// An IIO device "cutforce-adc": six voltages (0..5), a speed and a power, all signed 16-bit, little
// endian, and a time stamp, into a kfifo buffer. A scan of all of them is 24 bytes: 8 x s16, s64 ns.
//
//   /dev/cutforce_adc  write: whole scans, one or many. Each goes to whoever reads /dev/iio:deviceN,
//                      with the channels that he enabled; without a reader it is gone, as it is
//                      with a converter that nobody listens to.
//
// scale and offset of the voltages can be written, so that a test may choose what a count means.
// /sys/module/cutforce_bench/parameters/scans_lost: scans that found the reader's buffer full.
#include <linux/bits.h>
#include <linux/iio/buffer.h>
#include <linux/iio/iio.h>
#include <linux/iio/kfifo_buf.h>
#include <linux/miscdevice.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/uaccess.h>

#include "bench.h"

#define VOLTAGES 6
#define CHANNELS (VOLTAGES + 2)

struct scan {
	__le16 counts[CHANNELS];
	s64 time_ns;
};

enum kind { VOLTAGE, SPEED, POWER, KINDS };

struct converter {
	struct iio_dev *iio;
	struct miscdevice device;
	struct mutex lock; /* one scan at a time */
	struct scan last;
	int scale_nano[KINDS];
	int offset[KINDS];
	int rate_hz;
};

static uint scans_lost;
module_param(scans_lost, uint, 0644);
MODULE_PARM_DESC(scans_lost, "scans that found the reader's buffer full");

#define CHANNEL(number, ...)                                                                     \
	{                                                                                        \
		.scan_index = (number), .info_mask_separate = BIT(IIO_CHAN_INFO_RAW),            \
		.info_mask_shared_by_type = BIT(IIO_CHAN_INFO_SCALE) | BIT(IIO_CHAN_INFO_OFFSET), \
		.info_mask_shared_by_all = BIT(IIO_CHAN_INFO_SAMP_FREQ),                         \
		.scan_type = { .sign = 's',                                                      \
			       .realbits = 16,                                                   \
			       .storagebits = 16,                                                \
			       .endianness = IIO_LE },                                           \
		__VA_ARGS__                                                                      \
	}
#define VOLTAGE_CHANNEL(number) \
	CHANNEL(number, .type = IIO_VOLTAGE, .indexed = 1, .channel = (number))

static const struct iio_chan_spec channels[] = {
	VOLTAGE_CHANNEL(0),
	VOLTAGE_CHANNEL(1),
	VOLTAGE_CHANNEL(2),
	VOLTAGE_CHANNEL(3),
	VOLTAGE_CHANNEL(4),
	VOLTAGE_CHANNEL(5),
	CHANNEL(VOLTAGES, .type = IIO_ANGL_VEL),
	CHANNEL(VOLTAGES + 1, .type = IIO_POWER),
	IIO_CHAN_SOFT_TIMESTAMP(CHANNELS),
};

/* A scan always has all channels; the kernel takes from it what a reader enabled. */
static const unsigned long scan_masks[] = { GENMASK(CHANNELS - 1, 0), 0 };

static enum kind kind_of(const struct iio_chan_spec *channel)
{
	return channel->type == IIO_ANGL_VEL ? SPEED : channel->type == IIO_POWER ? POWER : VOLTAGE;
}

static int read_raw(struct iio_dev *iio, const struct iio_chan_spec *channel, int *value,
		    int *value2, long what)
{
	const struct converter *adc = iio_priv(iio);

	switch (what) {
	case IIO_CHAN_INFO_RAW:
		*value = (s16)le16_to_cpu(READ_ONCE(adc->last.counts[channel->scan_index]));
		return IIO_VAL_INT;
	case IIO_CHAN_INFO_SCALE:
		*value = adc->scale_nano[kind_of(channel)] / 1000000000;
		*value2 = adc->scale_nano[kind_of(channel)] % 1000000000;
		return IIO_VAL_INT_PLUS_NANO;
	case IIO_CHAN_INFO_OFFSET:
		*value = adc->offset[kind_of(channel)];
		return IIO_VAL_INT;
	case IIO_CHAN_INFO_SAMP_FREQ:
		*value = adc->rate_hz;
		return IIO_VAL_INT;
	}
	return -EINVAL;
}

static int write_raw(struct iio_dev *iio, const struct iio_chan_spec *channel, int value,
		     int value2, long what)
{
	struct converter *adc = iio_priv(iio);

	switch (what) {
	case IIO_CHAN_INFO_SCALE:
		if (value < 0 || value > 1 || value2 < 0)
			return -EINVAL;
		adc->scale_nano[kind_of(channel)] = value * 1000000000 + value2;
		return 0;
	case IIO_CHAN_INFO_OFFSET:
		adc->offset[kind_of(channel)] = value;
		return 0;
	case IIO_CHAN_INFO_SAMP_FREQ:
		if (value <= 0)
			return -EINVAL;
		adc->rate_hz = value;
		return 0;
	}
	return -EINVAL;
}

static int write_format(struct iio_dev *iio, const struct iio_chan_spec *channel, long what)
{
	return what == IIO_CHAN_INFO_SCALE ? IIO_VAL_INT_PLUS_NANO : IIO_VAL_INT;
}

static const struct iio_info information = {
	.read_raw = read_raw,
	.write_raw = write_raw,
	.write_raw_get_fmt = write_format,
};

static ssize_t scans_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	/* misc_open() leaves the device here */
	struct converter *adc = container_of(file->private_data, struct converter, device);
	size_t done;

	if (!size || size % sizeof(struct scan))
		return -EINVAL;
	for (done = 0; done < size; done += sizeof(struct scan)) {
		struct scan scan;

		if (copy_from_user(&scan, from + done, sizeof(scan)))
			return -EFAULT;
		mutex_lock(&adc->lock);
		adc->last = scan;
		if (iio_buffer_enabled(adc->iio) && iio_push_to_buffers(adc->iio, &scan))
			++scans_lost;
		mutex_unlock(&adc->lock);
	}
	return size;
}

static const struct file_operations operations = {
	.owner = THIS_MODULE,
	.write = scans_write,
	.llseek = noop_llseek,
};

static void forget_device(void *device)
{
	misc_deregister(device);
}

int cutforce_adc_create(struct device *parent)
{
	struct iio_dev *iio = devm_iio_device_alloc(parent, sizeof(struct converter));
	struct converter *adc;
	int failed;

	if (!iio)
		return -ENOMEM;
	adc = iio_priv(iio);
	*adc = (struct converter){
		.iio = iio,
		.device = { .minor = MISC_DYNAMIC_MINOR, .name = "cutforce_adc", .fops = &operations },
		.scale_nano = { 1000000, 1000000, 1000000 },
		.rate_hz = 8000,
	};
	mutex_init(&adc->lock);
	iio->name = "cutforce-adc";
	iio->info = &information;
	iio->channels = channels;
	iio->num_channels = ARRAY_SIZE(channels);
	iio->available_scan_masks = scan_masks;
	iio->modes = INDIO_DIRECT_MODE;

	failed = devm_iio_kfifo_buffer_setup(parent, iio, NULL);
	if (!failed)
		failed = devm_iio_device_register(parent, iio);
	if (!failed)
		failed = misc_register(&adc->device);
	return failed ? failed : devm_add_action_or_reset(parent, forget_device, &adc->device);
}
