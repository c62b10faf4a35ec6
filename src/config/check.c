/* SPDX-License-Identifier: Apache-2.0 */
/* What only shows between sections, and times that cannot be met. */
#include "config/load.h"
#include "drivebridge/driver.h"

#include <stdlib.h>
#include <string.h>

static unsigned line_of(const struct db_load *load, const char *section, const char *title,
                        unsigned head, const char *key)
{
	size_t place = db_outline_section_find(&load->outline, section, title);
	unsigned line = db_outline_key_line(&load->outline, place, key);

	return line > 0 ? line : head;
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
				&load->report,
				line_of(load, "bus", bus->name, bus->source_line, "device"),
				"device = %s is used by bus '%s' on line %u already; another port, or one bus for all its drives",
				bus->device, other->name, other->source_line);
			break;
		}
	}
}

static void check_pair(struct db_load *load, const struct db_drive_config *drive,
                       const struct db_drive_config *other)
{
	const struct db_config *config = load->config;
	const struct db_bus_config *bus;

	if (drive->unit != 0 && drive->unit == other->unit)
		db_report_error(
			&load->report,
			line_of(load, "drive", drive->name, drive->source_line, "unit"),
			"unit = %u belongs to drive '%s' on line %u already; a unit of its own for each drive",
			drive->unit, other->name, other->source_line);
	if (drive->bus >= config->bus_count || drive->bus != other->bus)
		return;
	bus = &config->buses[drive->bus];
	if (bus->driver && bus->driver->medium == DB_MEDIUM_SERIAL && bus->line == DB_LINE_RS232)
		db_report_error(
			&load->report,
			line_of(load, "drive", drive->name, drive->source_line, "bus"),
			"bus '%s' is an RS232 line and has drive '%s' already; one drive per RS232 line, or line = rs485",
			bus->name, other->name);
	else if (drive->address != 0 && drive->address == other->address)
		db_report_error(
			&load->report,
			line_of(load, "drive", drive->name, drive->source_line, "address"),
			"address = %u on bus '%s' belongs to drive '%s' on line %u already; an address of its own for each drive of a bus",
			drive->address, bus->name, other->name, other->source_line);
}

static void check_drives(struct db_load *load)
{
	const struct db_config *config = load->config;

	for (size_t i = 0; i < config->drive_count; i++) {
		const struct db_drive_config *drive = &config->drives[i];

		if (drive->unit != 0 && drive->unit == config->modbus.gateway_unit)
			db_report_error(
				&load->report,
				line_of(load, "drive", drive->name, drive->source_line, "unit"),
				"unit = %u is the gateway's own unit (gateway-unit); another unit for one of them",
				drive->unit);
		for (size_t j = 0; j < i; j++)
			check_pair(load, drive, &config->drives[j]);
	}
}

size_t db_config_drives_on(const struct db_config *config, size_t bus)
{
	size_t count = 0;

	for (size_t i = 0; i < config->drive_count; i++)
		count += config->drives[i].bus == bus;
	return count;
}

int64_t db_config_confirm_time(const struct db_bus_config *bus)
{
	db_time own = bus->driver->command_time(bus);
	db_time poll = bus->driver->poll_time(bus);

	return own + (poll > own ? poll : own);
}

static double milliseconds(db_time time)
{
	return (double)time / (double)DB_NS_PER_MS;
}

static unsigned whole_milliseconds(db_time time)
{
	return (unsigned)((time + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
}

static void warn_cycle(struct db_load *load, size_t index)
{
	const struct db_bus_config *bus = &load->config->buses[index];
	size_t drives = db_config_drives_on(load->config, index);
	db_time one = bus->driver->poll_time(bus);
	db_time all = one * (db_time)drives;

	if (all <= (db_time)bus->cycle_ms * DB_NS_PER_MS)
		return;
	db_report_warning(
		&load->report, line_of(load, "bus", bus->name, bus->source_line, "cycle-ms"),
		"cycle of %u ms cannot fit %zu drive%s: one status exchange takes %.2f ms at %u baud, all of them %.2f ms; set cycle-ms = %u or raise the baud rate",
		bus->cycle_ms, drives, drives == 1 ? "" : "s", milliseconds(one), bus->baud,
		milliseconds(all), whole_milliseconds(all));
}

static void warn_confirm(struct db_load *load, size_t index)
{
	const struct db_bus_config *bus = &load->config->buses[index];
	unsigned confirm_ms = load->config->modbus.confirm_ms;
	db_time needed = db_config_confirm_time(bus);

	if (load->config->modbus.accept_writes || db_config_drives_on(load->config, index) == 0 ||
	    needed <= (db_time)confirm_ms * DB_NS_PER_MS)
		return;
	db_report_warning(
		&load->report, line_of(load, "modbus", "", bus->source_line, "confirm-ms"),
		"confirm-ms = %u cannot be met on bus '%s': at %u baud a command takes %.2f ms, and %.2f ms when it has to wait for the exchange on the wire; set confirm-ms = %u in section modbus or raise the baud rate",
		confirm_ms, bus->name, bus->baud, milliseconds(bus->driver->command_time(bus)),
		milliseconds(needed), whole_milliseconds(needed));
}

void db_load_check(struct db_load *load)
{
	check_devices(load);
	check_drives(load);
	if (load->report.errors > 0)
		return;
	for (size_t i = 0; i < load->config->bus_count; i++) {
		warn_cycle(load, i);
		warn_confirm(load, i);
	}
}
