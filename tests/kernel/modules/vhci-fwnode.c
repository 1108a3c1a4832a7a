// SPDX-License-Identifier: GPL-2.0
/*
 * vhci-fwnode: gives the virtual USB host controller a firmware node.
 *
 * libcamera names a USB camera after the first parent device that firmware describes (sysfs
 * firmware_node/path or of_node) and drops a camera without one. vhci_hcd has none: this adds
 * vhci_hcd.0/firmware_node/path.
 */
#include <linux/module.h>
#include <linux/platform_device.h>

static struct kobject *node;
static struct device *controller;

static ssize_t path_show(struct kobject *object, struct kobj_attribute *attribute, char *text)
{
	return sysfs_emit(text, "\\_SB_.VHCI\n");
}
static struct kobj_attribute path_attribute = __ATTR_RO(path);

static int __init fwnode_init(void)
{
	int error;

	controller = bus_find_device_by_name(&platform_bus_type, NULL, "vhci_hcd.0");
	if (!controller)
		return -ENODEV;
	node = kobject_create_and_add("firmware_node", &controller->kobj);
	error = node ? sysfs_create_file(node, &path_attribute.attr) : -ENOMEM;
	if (error) {
		kobject_put(node);
		put_device(controller);
	}
	return error;
}

static void __exit fwnode_exit(void)
{
	kobject_put(node);
	put_device(controller);
}

module_init(fwnode_init);
module_exit(fwnode_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("gives vhci_hcd.0 a firmware node path");
