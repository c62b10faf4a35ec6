/* SPDX-License-Identifier: Apache-2.0 */
/* What only shows between sections: the same thing used twice. */
#include "config/load.h"
#include "drivebridge/driver.h"

#include <stdlib.h>
#include <string.h>

unsigned db_load_line(const struct db_load *load, const char *section, const char *title,
                      unsigned head, const char *key)
{
	size_t place = db_outline_section_find(&load->outline, section, title);
	unsigned line = db_outline_key_line(&load->outline, place, key);

	return line > 0 ? line : head;
}

static unsigned bus_line(const struct db_load *load, const struct db_bus_config *bus,
                         const char *key)
{
	return db_load_line(load, "bus", bus->name, bus->source_line, key);
}

static unsigned drive_line(const struct db_load *load, const struct db_drive_config *drive,
                           const char *key)
{
	return db_load_line(load, "drive", drive->name, drive->source_line, key);
}

/* Two names of one port (a link of /dev/serial/by-id and the node itself) are the same device. */
static bool same_device(const char *a, const char *b)
{
	char *real_a = realpath(a, NULL);
	char *real_b = realpath(b, NULL);
	bool same = strcmp(real_a ? real_a : a, real_b ? real_b : b) == 0;

	free(real_a);
	free(real_b);
	return same;
}

static void check_devices(struct db_load *load)
{
	const struct db_config *config = load->config;

	for (size_t i = 0; i < config->bus_count; i++) {
		const struct db_bus_config *bus = &config->buses[i];

		for (size_t j = 0; j < i && bus->device; j++) {
			const struct db_bus_config *other = &config->buses[j];

			if (!other->device || !same_device(bus->device, other->device))
				continue;
			db_report_error(
				&load->report, bus_line(load, bus, "device"),
				"device = %s is used by bus '%s' on %s already; another port, or one bus for all its drives",
				bus->device, other->name,
				db_report_place(&load->report, other->source_line).text);
			break;
		}
	}
}

static void check_units(struct db_load *load, const struct db_drive_config *drive,
                        const struct db_drive_config *other)
{
	if (drive->unit != 0 && drive->unit == other->unit)
		db_report_error(
			&load->report, drive_line(load, drive, "unit"),
			"unit = %u belongs to drive '%s' on %s already; a unit of its own for each drive",
			drive->unit, other->name,
			db_report_place(&load->report, other->source_line).text);
}

/* The second unit of this drive, against all of the other one. */
static void check_vendor_unit(struct db_load *load, const struct db_drive_config *drive,
                              const struct db_drive_config *other)
{
	bool own = drive == other;

	if (drive->vendor_unit == 0 || !(drive->vendor_unit == other->unit ||
	                                 (!own && drive->vendor_unit == other->vendor_unit)))
		return;
	db_report_error(
		&load->report, drive_line(load, drive, "vendor-unit"),
		"vendor-unit = %u belongs to drive '%s' on %s already; a unit that nothing else has",
		drive->vendor_unit, other->name,
		db_report_place(&load->report, other->source_line).text);
}

static bool has_axis(const struct db_load *load, const struct db_drive_config *drive)
{
	size_t place = db_outline_section_find(&load->outline, "drive", drive->name);

	return db_outline_key_line(&load->outline, place, "axis") > 0;
}

/* Two drives of one controller. */
static void check_axes(struct db_load *load, const struct db_drive_config *drive,
                       const struct db_drive_config *other)
{
	if (!has_axis(load, drive) || !has_axis(load, other) || drive->axis != other->axis)
		return;
	db_report_error(
		&load->report, drive_line(load, drive, "axis"),
		"this axis of address %u belongs to drive '%s' on %s already; an axis of its own for each drive of a controller",
		drive->address, other->name,
		db_report_place(&load->report, other->source_line).text);
}

/* Two drives of one bus. */
static void check_addresses(struct db_load *load, const struct db_drive_config *drive,
                            const struct db_drive_config *other)
{
	const struct db_bus_config *bus = &load->config->buses[drive->bus];
	const struct db_driver *driver = bus->driver;
	bool same = drive->address == other->address;

	if (!driver)
		return;
	if (driver->medium == DB_MEDIUM_SERIAL && bus->line == DB_LINE_RS232 &&
	    (driver->axes == 0 || !same))
		db_report_error(
			&load->report, drive_line(load, drive, "bus"),
			"bus '%s' is an RS232 line and has drive '%s' already; one %s per RS232 line, or line = rs485",
			bus->name, other->name, driver->axes > 0 ? "controller" : "drive");
	else if (same && drive->address != 0 && driver->axes > 0)
		check_axes(load, drive, other);
	else if (same && drive->address != 0)
		db_report_error(
			&load->report, drive_line(load, drive, "address"),
			"address = %u on bus '%s' belongs to drive '%s' on %s already; an address of its own for each drive of a bus",
			drive->address, bus->name, other->name,
			db_report_place(&load->report, other->source_line).text);
}

/* A drive that does not say which axis it is, though others are behind the same address. */
static void check_axis_given(struct db_load *load, size_t index)
{
	const struct db_config *config = load->config;
	const struct db_drive_config *drive = &config->drives[index];
	const struct db_bus_config *bus = &config->buses[drive->bus];

	if (!bus->driver || bus->driver->axes == 0 || drive->address == 0 || has_axis(load, drive))
		return;
	for (size_t i = 0; i < config->drive_count; i++) {
		const struct db_drive_config *other = &config->drives[i];

		if (i == index || other->bus != drive->bus || other->address != drive->address)
			continue;
		db_report_error(
			&load->report, drive->source_line,
			"drive '%s' has no key 'axis', which must be given because drive '%s' is behind address %u of bus '%s' too; add axis = x, for instance",
			drive->name, other->name, drive->address, bus->name);
		return;
	}
}

static void check_drive(struct db_load *load, size_t index)
{
	const struct db_config *config = load->config;
	const struct db_drive_config *drive = &config->drives[index];
	size_t errors = db_report_errors(&load->report);

	if (drive->unit != 0 && drive->unit == config->modbus.gateway_unit)
		db_report_error(
			&load->report, drive_line(load, drive, "unit"),
			"unit = %u is the gateway's own unit (gateway-unit); another unit for one of them",
			drive->unit);
	if (drive->vendor_unit != 0 && drive->vendor_unit == config->modbus.gateway_unit)
		db_report_error(
			&load->report, drive_line(load, drive, "vendor-unit"),
			"vendor-unit = %u is the gateway's own unit (gateway-unit); another unit for one of them",
			drive->vendor_unit);
	if (drive->bus < config->bus_count)
		check_axis_given(load, index);
	check_vendor_unit(load, drive, drive);
	/* One complaint is enough: a drive that was copied a thousand times has as many others. */
	for (size_t i = 0; i < index && db_report_errors(&load->report) == errors; i++) {
		const struct db_drive_config *other = &config->drives[i];

		check_units(load, drive, other);
		check_vendor_unit(load, drive, other);
		/* The later drive's unit against the second unit of an earlier one. */
		if (drive->vendor_unit != other->vendor_unit)
			check_vendor_unit(load, other, drive);
		if (drive->bus < config->bus_count && drive->bus == other->bus)
			check_addresses(load, drive, other);
	}
}

void db_load_check(struct db_load *load)
{
	check_devices(load);
	for (size_t i = 0; i < load->config->drive_count; i++)
		check_drive(load, i);
	/* From here on everything has to be there. */
	if (load->report.errors == 0)
		db_load_check_interfaces(load);
	if (load->report.errors == 0)
		db_load_fill_times(load);
	if (load->report.errors == 0)
		db_load_check_families(load);
	if (load->report.errors == 0)
		db_load_check_times(load);
}
