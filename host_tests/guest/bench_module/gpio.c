// SPDX-License-Identifier: GPL-2.0
// 16 GPIO lines, label "cutforce-bench". There is no set_multiple: the kernel sets a group of lines
// one after the other, and the states in between are real, as they are on PL061 and on a Raspberry
// Pi. A chip that hides them (gpio-sim does) would let a torn byte pass.
//
//   /dev/cutforce_gpio      read: 16 bits, the level of every line, at once
//                           write: 16 bits, the level that the world puts on every input
//   /dev/cutforce_gpio_log  read: every change of an output in order, 16 bytes each: u64 time in ns
//                           (CLOCK_MONOTONIC), u32 line, u32 level. Waits for the first. Line
//                           0xffffffff: that many changes were lost before this one.
//
// Lines that are released keep their level, as on most chips.
#include <linux/bitops.h>
#include <linux/gpio/driver.h>
#include <linux/ktime.h>
#include <linux/miscdevice.h>
#include <linux/module.h>
#include <linux/poll.h>
#include <linux/spinlock.h>
#include <linux/uaccess.h>
#include <linux/vmalloc.h>
#include <linux/wait.h>

#include "bench.h"

#define LINES 16
#define LOG_SIZE (1u << 19) /* every pair of bytes, with a strobe: about 400000 changes */
#define LOST_LINE 0xffffffffu

struct change {
	u64 time_ns;
	u32 line;
	u32 level;
};

static struct {
	struct gpio_chip chip;
	raw_spinlock_t lock; /* set() may not sleep, under PREEMPT_RT either */
	u16 outputs, inputs, is_output;
	struct change *log;
	u32 written, read, lost;
	wait_queue_head_t changed;
} bench;

static void remember(u32 line, u32 level)
{
	/* Room for two: what follows a loss is preceded by its count. */
	if (LOG_SIZE - (bench.written - bench.read) < 2) {
		++bench.lost;
		return;
	}
	if (bench.lost) {
		bench.log[bench.written++ % LOG_SIZE] =
			(struct change){ ktime_get_ns(), LOST_LINE, bench.lost };
		bench.lost = 0;
	}
	bench.log[bench.written++ % LOG_SIZE] = (struct change){ ktime_get_ns(), line, level };
}

/* What the world sees. An input that becomes an output is a change too, if its level moves. */
static u16 levels(void)
{
	return (bench.outputs & bench.is_output) | (bench.inputs & ~bench.is_output);
}

static void drive(unsigned int line, int level, bool is_output)
{
	unsigned long flags;
	u16 before;

	raw_spin_lock_irqsave(&bench.lock, flags);
	before = levels();
	bench.outputs = level ? bench.outputs | BIT(line) : bench.outputs & ~BIT(line);
	if (is_output)
		bench.is_output |= BIT(line);
	if ((before ^ levels()) & BIT(line))
		remember(line, !!level);
	raw_spin_unlock_irqrestore(&bench.lock, flags);
	wake_up_interruptible(&bench.changed);
}

static void set(struct gpio_chip *chip, unsigned int line, int level)
{
	drive(line, level, false);
}

static int direction_output(struct gpio_chip *chip, unsigned int line, int level)
{
	drive(line, level, true);
	return 0;
}

static int direction_input(struct gpio_chip *chip, unsigned int line)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&bench.lock, flags);
	bench.is_output &= ~BIT(line);
	raw_spin_unlock_irqrestore(&bench.lock, flags);
	return 0;
}

static int get_direction(struct gpio_chip *chip, unsigned int line)
{
	return bench.is_output & BIT(line) ? GPIO_LINE_DIRECTION_OUT : GPIO_LINE_DIRECTION_IN;
}

static int get(struct gpio_chip *chip, unsigned int line)
{
	return !!(READ_ONCE(bench.is_output) & BIT(line) ? READ_ONCE(bench.outputs) & BIT(line)
							 : READ_ONCE(bench.inputs) & BIT(line));
}

static ssize_t lines_read(struct file *file, char __user *to, size_t size, loff_t *at)
{
	unsigned long flags;
	u16 now;

	if (size < sizeof(now))
		return -EINVAL;
	raw_spin_lock_irqsave(&bench.lock, flags);
	now = levels();
	raw_spin_unlock_irqrestore(&bench.lock, flags);
	return copy_to_user(to, &now, sizeof(now)) ? -EFAULT : sizeof(now);
}

static ssize_t lines_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	u16 now;

	if (size != sizeof(now))
		return -EINVAL;
	if (copy_from_user(&now, from, sizeof(now)))
		return -EFAULT;
	WRITE_ONCE(bench.inputs, now);
	return sizeof(now);
}

static ssize_t log_read(struct file *file, char __user *to, size_t size, loff_t *at)
{
	size_t count = 0;

	if (size < sizeof(struct change))
		return -EINVAL;
	if (READ_ONCE(bench.written) == bench.read && file->f_flags & O_NONBLOCK)
		return -EAGAIN;
	if (wait_event_interruptible(bench.changed, READ_ONCE(bench.written) != bench.read))
		return -ERESTARTSYS;
	while (count + sizeof(struct change) <= size) {
		struct change next;
		unsigned long flags;
		bool empty;

		raw_spin_lock_irqsave(&bench.lock, flags);
		empty = bench.read == bench.written;
		if (!empty)
			next = bench.log[bench.read++ % LOG_SIZE];
		raw_spin_unlock_irqrestore(&bench.lock, flags);
		if (empty)
			break;
		if (copy_to_user(to + count, &next, sizeof(next)))
			return -EFAULT;
		count += sizeof(next);
	}
	return count;
}

static __poll_t log_poll(struct file *file, poll_table *table)
{
	poll_wait(file, &bench.changed, table);
	return READ_ONCE(bench.written) != bench.read ? EPOLLIN | EPOLLRDNORM : 0;
}

static const struct file_operations lines_operations = {
	.owner = THIS_MODULE,
	.read = lines_read,
	.write = lines_write,
	.llseek = noop_llseek,
};

static const struct file_operations log_operations = {
	.owner = THIS_MODULE,
	.read = log_read,
	.poll = log_poll,
	.llseek = noop_llseek,
};

static struct miscdevice lines_device = {
	.minor = MISC_DYNAMIC_MINOR,
	.name = "cutforce_gpio",
	.fops = &lines_operations,
};

static struct miscdevice log_device = {
	.minor = MISC_DYNAMIC_MINOR,
	.name = "cutforce_gpio_log",
	.fops = &log_operations,
};

static void forget_log(void *log)
{
	vfree(log);
}

static void forget_device(void *device)
{
	misc_deregister(device);
}

static int make_device(struct device *parent, struct miscdevice *device)
{
	int failed = misc_register(device);

	return failed ? failed : devm_add_action_or_reset(parent, forget_device, device);
}

int cutforce_gpio_create(struct device *parent)
{
	int failed;

	raw_spin_lock_init(&bench.lock);
	init_waitqueue_head(&bench.changed);
	bench.log = vzalloc(LOG_SIZE * sizeof(*bench.log));
	if (!bench.log)
		return -ENOMEM;
	failed = devm_add_action_or_reset(parent, forget_log, bench.log);
	if (failed)
		return failed;
	bench.chip = (struct gpio_chip){
		.label = "cutforce-bench",
		.parent = parent,
		.owner = THIS_MODULE,
		.base = -1,
		.ngpio = LINES,
		.get_direction = get_direction,
		.direction_input = direction_input,
		.direction_output = direction_output,
		.get = get,
		.set = set,
	};
	failed = devm_gpiochip_add_data(parent, &bench.chip, NULL);
	if (!failed)
		failed = make_device(parent, &lines_device);
	return failed ? failed : make_device(parent, &log_device);
}
