/* SPDX-License-Identifier: Apache-2.0 */
/* From the sections of a file to the structs of the configuration. */
#include "config/keys.h"
#include "config/load.h"
#include "drivebridge/driver.h"

#include <stdlib.h>
#include <string.h>

static struct db_section open_section(struct db_load *load, const char *name, unsigned index)
{
	struct db_section section = { .load = load, .name = name, .title = "" };

	section.values = cfg_getnsec(load->root, name, index);
	if (section.values && cfg_title(section.values))
		section.title = cfg_title(section.values);
	section.place = db_outline_section_find(&load->outline, name, section.title);
	if (section.place != DB_OUTLINE_TOP)
		section.line = load->outline.sections[section.place].line;
	return section;
}

static void read_modbus(struct db_load *load)
{
	struct db_modbus_config *modbus = &load->config->modbus;
	struct db_section section = open_section(load, "modbus", 0);

	modbus->listen = db_section_text(&section, "listen");
	modbus->allow_read = db_section_networks(&section, "allow-read", &modbus->allow_read_count);
	modbus->allow_write = db_section_networks(&section, "allow-write",
	                                          &modbus->allow_write_count);
	modbus->low_word_first = db_section_word(&section, "word-order") != 0;
	modbus->confirm_ms = db_section_number(&section, "confirm-ms");
	modbus->accept_writes = db_section_word(&section, "write-confirm") != 0;
	modbus->stale_values = db_section_word(&section, "stale") != 0;
	modbus->gateway_unit = db_section_number(&section, "gateway-unit");
	modbus->max_clients = db_section_number(&section, "max-clients");
	modbus->max_pipelined = db_section_number(&section, "max-pipelined");
	modbus->frame_timeout_ms = db_section_number(&section, "frame-timeout-ms");
	modbus->idle_timeout_s = db_section_number(&section, "idle-timeout-s");
}

static void list_protocols(char *text, size_t size)
{
	size_t used = 0;

	text[0] = '\0';
	for (size_t i = 0; db_drivers[i] && used < size; i++) {
		int length = snprintf(text + used, size - used, "%s%s", i > 0 ? ", " : "",
		                      db_drivers[i]->name);

		if (length > 0)
			used += (size_t)length;
	}
}

static const struct db_driver *read_protocol(const struct db_section *section)
{
	char *name = db_section_text(section, "protocol");
	const struct db_driver *driver = name ? db_driver_find(name) : NULL;

	if (name && !driver) {
		char known[256];

		list_protocols(known, sizeof(known));
		db_report_error(&section->load->report, db_section_line(section, "protocol"),
		                "unknown protocol '%s'; known are: %s", name, known);
	}
	free(name);
	return driver;
}

/* Keys of families of another kind. `driver` may be null: then nothing can be said. */
static void refuse_foreign_keys(const struct db_section *section, const struct db_driver *driver)
{
	size_t count;
	const struct db_config_key *keys = db_config_keys(&count);

	if (!driver || driver->medium != DB_MEDIUM_SERIAL)
		return;
	for (size_t i = 0; i < count; i++) {
		const struct db_config_key *key = &keys[i];

		if (strcmp(key->section, section->name) != 0 || key->only[0] == '\0' ||
		    !db_section_has(section, key->name))
			continue;
		db_report_error(
			&section->load->report, db_section_line(section, key->name),
			"%s is for %s, but %s runs on a serial line with one axis per drive; remove it%s",
			key->name, key->only, driver->name,
			strcmp(key->section, "bus") == 0 ? " and name the port with device" : "");
	}
}

static void read_bus(struct db_load *load, unsigned index, struct db_bus_config *bus)
{
	struct db_section section = open_section(load, "bus", index);

	bus->name = strdup(section.title);
	bus->source_file = load->file;
	bus->source_line = section.line;
	bus->driver = read_protocol(&section);
	bus->transport = &db_transport_serial;
	refuse_foreign_keys(&section, bus->driver);
	bus->device = db_section_text(&section, "device");
	if (bus->device && bus->device[0] != '/')
		db_report_error(
			&load->report, db_section_line(&section, "device"),
			"device = %s is no whole path; one that begins with /, such as /dev/ttyUSB0",
			bus->device);
	bus->baud = db_section_number(&section, "baud");
	if (bus->baud == 0 && bus->driver)
		bus->baud = bus->driver->default_baud;
	bus->parity = (enum db_parity)db_section_word(&section, "parity");
	bus->stop_bits = db_section_number(&section, "stop-bits");
	bus->line = (enum db_line)db_section_word(&section, "line");
	bus->cycle_ms = db_section_number(&section, "cycle-ms");
	bus->drive_latency_ms = db_section_number(&section, "drive-latency-ms");
	bus->retries = db_section_number(&section, "retries");
	bus->queue = db_section_number(&section, "queue");
	bus->save_interval_s = db_section_number(&section, "save-interval-s");
	bus->priority = db_section_number(&section, "priority");
}

/* Index of the drive's bus; bus_count when there is none, which is reported. */
static size_t read_drive_bus(const struct db_section *section)
{
	const struct db_config *config = section->load->config;
	char *name = db_section_text(section, "bus");
	size_t index = 0;

	if (!name)
		return config->bus_count;
	while (index < config->bus_count && strcmp(config->buses[index].name, name) != 0)
		index++;
	if (index == config->bus_count)
		db_report_error(
			&section->load->report, db_section_line(section, "bus"),
			"there is no bus '%s'; the name of a section \"bus %s { ... }\" of this file",
			name, name);
	free(name);
	return index;
}

static void check_address(const struct db_section *section, const struct db_bus_config *bus,
                          unsigned address)
{
	struct db_report *report = &section->load->report;
	const struct db_driver *driver = bus->driver;
	unsigned line = db_section_line(section, "address");

	if (!driver)
		return;
	if (driver->medium == DB_MEDIUM_SERIAL && bus->line == DB_LINE_RS232) {
		if (address != 0)
			db_report_error(
				report, line,
				"address = %u cannot be on bus '%s', whose line is RS232; remove it, or set line = rs485 there",
				address, bus->name);
	} else if (!db_section_has(section, "address")) {
		db_report_error(
			report, section->line,
			"drive '%s' has no key 'address', which must be given on bus '%s'; add address = ..., a whole number from %u to %u",
			section->title, bus->name, driver->address_min, driver->address_max);
	} else if (address < driver->address_min || address > driver->address_max) {
		db_report_error(
			report, line,
			"address = %u is out of range; %s drives have addresses from %u to %u",
			address, driver->name, driver->address_min, driver->address_max);
	}
}

static void read_drive(struct db_load *load, unsigned index, struct db_drive_config *drive)
{
	struct db_section section = open_section(load, "drive", index);
	size_t errors;

	drive->name = strdup(section.title);
	drive->source_file = load->file;
	drive->source_line = section.line;
	drive->bus = read_drive_bus(&section);
	errors = db_report_errors(&load->report);
	drive->address = db_section_number(&section, "address");
	if (drive->bus < load->config->bus_count) {
		const struct db_bus_config *bus = &load->config->buses[drive->bus];

		if (db_report_errors(&load->report) == errors)
			check_address(&section, bus, drive->address);
		refuse_foreign_keys(&section, bus->driver);
	}
	drive->unit = db_section_number(&section, "unit");
	drive->counts_per_unit = db_section_real(&section, "counts-per-unit");
	drive->unit_name = db_section_text(&section, "unit-name");
	drive->on_client_loss = (enum db_on_loss)db_section_word(&section, "on-client-loss");
	drive->on_exit = db_section_has(&section, "on-exit") ?
	                         (enum db_on_loss)db_section_word(&section, "on-exit") :
	                         drive->on_client_loss;
	drive->watchdog_ms = db_section_number(&section, "watchdog-ms");
}

bool db_load_sections(struct db_load *load)
{
	struct db_config *config = load->config;
	unsigned buses = cfg_size(load->root, "bus");
	unsigned drives = cfg_size(load->root, "drive");

	/* One more than needed: calloc() of nothing may give null. */
	config->buses = calloc((size_t)buses + 1, sizeof(*config->buses));
	config->drives = calloc((size_t)drives + 1, sizeof(*config->drives));
	if (!config->buses || !config->drives)
		return false;
	read_modbus(load);
	config->bus_count = buses;
	for (unsigned i = 0; i < buses; i++) {
		read_bus(load, i, &config->buses[i]);
		if (!config->buses[i].name)
			return false;
	}
	config->drive_count = drives;
	for (unsigned i = 0; i < drives; i++) {
		read_drive(load, i, &config->drives[i]);
		if (!config->drives[i].name)
			return false;
	}
	return true;
}
