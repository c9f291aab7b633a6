/* SPDX-License-Identifier: GPL-2.0 */
/*
 * A test bench inside the emulated board's kernel: what QEMU has no device for.
 *
 *   gpio.c  16 lines that change one by one, as on most boards, and remember in which order
 *   adc.c   a sampled-signal converter whose samples a program writes
 *
 * The service under test sees real drivers behind the kernel's own interfaces; the test sees the
 * other side in /dev/cutforce_*. In C and under GPL-2.0, alone in this tree: it is linked into a
 * kernel that is both.
 */
#ifndef CUTFORCE_BENCH_H
#define CUTFORCE_BENCH_H

struct device;

int cutforce_gpio_create(struct device *parent);
int cutforce_adc_create(struct device *parent);

#endif
