// SPDX-License-Identifier: GPL-2.0
// One platform device that carries both parts; everything is released with it.
#include <linux/err.h>
#include <linux/module.h>
#include <linux/platform_device.h>

#include "bench.h"

static struct platform_device *bench;

static int bench_probe(struct platform_device *device)
{
	int failed = cutforce_gpio_create(&device->dev);

	return failed ? failed : cutforce_adc_create(&device->dev);
}

static struct platform_driver bench_driver = {
	.driver.name = "cutforce-bench",
	.probe = bench_probe,
};

static int __init bench_init(void)
{
	int failed = platform_driver_register(&bench_driver);

	if (failed)
		return failed;
	bench = platform_device_register_simple("cutforce-bench", PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(bench)) {
		platform_driver_unregister(&bench_driver);
		return PTR_ERR(bench);
	}
	return 0;
}

static void __exit bench_exit(void)
{
	platform_device_unregister(bench);
	platform_driver_unregister(&bench_driver);
}

module_init(bench_init);
module_exit(bench_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("Test bench for cutforce: GPIO lines and a converter that a test looks behind");
