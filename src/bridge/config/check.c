/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"

#include "codec/can.h"
#include "config/times.h"
#include "drivebridge/driver.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* --- the same thing used twice ---------------------------------------------------------------- */

static unsigned drive_line(const struct db_load *load, const struct db_drive_config *drive,
                           const char *key)
{
	return db_section_find_line(load, "drive", drive->name, drive->source_line, key);
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
			db_messages_add_error(
				&load->messages,
				db_section_find_line(load, "bus", bus->name, bus->source_line,
			                             "device"),
				"device = %s is used by bus '%s' on %s already; another port, or "
				"one bus for all its drives",
				bus->device, other->name,
				db_messages_name_line(&load->messages, other->source_line).text);
			break;
		}
	}
}

/* A line's port against those of the buses, and of the lines before it. */
static void check_line_device(struct db_load *load, size_t index)
{
	const struct db_config *config = load->config;
	const struct db_rtu_config *line = &config->modbus.lines[index];
	const char *what = NULL;
	const char *name = NULL;
	unsigned place = 0;

	for (size_t i = 0; i < config->bus_count && line->device && !what; i++) {
		const struct db_bus_config *bus = &config->buses[i];

		if (!bus->device || !same_device(line->device, bus->device))
			continue;
		what = "bus";
		name = bus->name;
		place = bus->source_line;
	}
	for (size_t i = 0; i < index && line->device && !what; i++) {
		const struct db_rtu_config *other = &config->modbus.lines[i];

		if (!other->device || !same_device(line->device, other->device))
			continue;
		what = "line";
		name = other->name;
		place = other->source_line;
	}
	if (what)
		db_messages_add_error(&load->messages,
		                      db_section_find_line(load, "modbus-rtu", line->name,
		                                           line->source_line, "device"),
		                      "device = %s is used by %s '%s' on %s already; another port",
		                      line->device, what, name,
		                      db_messages_name_line(&load->messages, place).text);
}

/* The gateway's further unit among those of an endpoint; 0: it has none there. */
static unsigned gateway_unit_of(const struct db_config *config, uint32_t endpoint)
{
	struct db_endpoint_config found;

	return db_modbus_endpoint_find(&config->modbus, endpoint, &found) ? found.gateway_unit : 0;
}

/* Whether its PLC waits long enough, and its units are there. Needs times that are filled in. */
static void check_line(struct db_load *load, const struct db_rtu_config *line)
{
	const struct db_config *config = load->config;
	const struct db_modbus_config *modbus = &config->modbus;
	unsigned slowest = modbus->confirm_ms + (unsigned)(db_times_of_line(line) / DB_NS_PER_MS) +
	                   1;

	if (slowest > line->answer_timeout_ms)
		db_messages_add_warning(
			&load->messages,
			db_section_find_line(load, "modbus-rtu", line->name, line->source_line,
		                             "answer-timeout-ms"),
			"answer-timeout-ms = %u: an answer can take %u ms with confirm-ms = %u and "
			"%u baud, and is not sent then; let the PLC wait longer and say so here, "
			"or lower confirm-ms",
			line->answer_timeout_ms, slowest, modbus->confirm_ms, line->baud);
	for (unsigned unit = 1; unit <= 247; unit++) {
		/* All of them, or those of drives. */
		if (db_section_find_line(load, "modbus-rtu", line->name, 0, "units") == 0)
			return;
		bool there = unit == gateway_unit_of(config, line->endpoint);

		for (size_t i = 0; i < config->drive_count; i++) {
			const struct db_drive_config *drive = &config->drives[i];

			there = there || (drive->endpoint == line->endpoint &&
			                  (drive->unit == unit || drive->vendor_unit == unit));
		}
		if (there || !db_rtu_has_unit(line, unit))
			continue;
		db_messages_add_warning(
			&load->messages,
			db_section_find_line(load, "modbus-rtu", line->name, line->source_line,
		                             "units"),
			"units: unit %u is of no drive, and not gateway-unit: it gets no answer",
			unit);
		return;
	}
}

/* An endpoint against those before it, of which the section modbus is the first. */
static void check_endpoint(struct db_load *load, size_t index)
{
	const struct db_modbus_config *modbus = &load->config->modbus;
	const struct db_endpoint_config *endpoint = &modbus->endpoints[index];
	const char *name = endpoint->name;
	unsigned head = endpoint->source_line;

	for (size_t i = 0; i <= index; i++) {
		const struct db_endpoint_config other = db_modbus_endpoint_at(modbus, i);
		const char *where = other.name ? other.name : "modbus";
		const char *listen = other.listen;
		const char *secure = other.secure_socket;

		if (listen && endpoint->listen && strcmp(listen, endpoint->listen) == 0 &&
		    strcmp(strrchr(listen, ':'), ":0") != 0)
			db_messages_add_error(
				&load->messages,
				db_section_find_line(load, "endpoint", name, head, "listen"),
				"listen = %s is where %s listens already; another port or address",
				listen, where);
		if (secure && endpoint->secure_socket && strcmp(secure, DB_NO_SOCKET) != 0 &&
		    strcmp(secure, endpoint->secure_socket) == 0)
			db_messages_add_error(
				&load->messages,
				db_section_find_line(load, "endpoint", name, head, "secure-socket"),
				"secure-socket = %s is that of %s already; another path", secure,
				where);
		if (other.number == endpoint->number)
			db_messages_add_error(
				&load->messages, head,
				"the names '%s' and '%s' have the same internal number; choose "
				"another name for one of them",
				name, where);
	}
}

static void warn_of_no_drives(struct db_load *load, const struct db_endpoint_config *endpoint)
{
	for (size_t i = 0; i < load->config->drive_count; i++) {
		if (load->config->drives[i].endpoint == endpoint->number)
			return;
	}
	db_messages_add_warning(&load->messages, endpoint->source_line,
	                        "endpoint '%s' has no drive: only the gateway's own unit answers "
	                        "there; endpoint = %s in a section drive gives it one",
	                        endpoint->name, endpoint->name);
}

/* Checks the second unit of this drive against all units of the other one. */
static void check_vendor_unit(struct db_load *load, const struct db_drive_config *drive,
                              const struct db_drive_config *other)
{
	bool own = drive == other;

	if (drive->vendor_unit == 0 || drive->endpoint != other->endpoint ||
	    !(drive->vendor_unit == other->unit ||
	      (!own && drive->vendor_unit == other->vendor_unit)))
		return;
	db_messages_add_error(&load->messages, drive_line(load, drive, "vendor-unit"),
	                      "vendor-unit = %u belongs to drive '%s' on %s already; a unit that "
	                      "nothing else has",
	                      drive->vendor_unit, other->name,
	                      db_messages_name_line(&load->messages, other->source_line).text);
}

static bool has_axis(const struct db_load *load, const struct db_drive_config *drive)
{
	return db_section_find_line(load, "drive", drive->name, 0, "axis") > 0;
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
		db_messages_add_error(&load->messages, drive_line(load, drive, "bus"),
		                      "bus '%s' is an RS232 line and has drive '%s' already; one "
		                      "%s per RS232 line, or line = rs485",
		                      bus->name, other->name,
		                      driver->axes > 0 ? "controller" : "drive");
	else if (same && drive->address != 0 && driver->axes > 0) {
		/* Two drives of one controller. */
		if (has_axis(load, drive) && has_axis(load, other) && drive->axis == other->axis) {
			db_messages_add_error(
				&load->messages, drive_line(load, drive, "axis"),
				"this axis of address %u belongs to drive '%s' on %s already; an "
				"axis of its own for each drive of a controller",
				drive->address, other->name,
				db_messages_name_line(&load->messages, other->source_line).text);
		}
	} else if (same && drive->address != 0)
		db_messages_add_error(
			&load->messages, drive_line(load, drive, "address"),
			"address = %u on bus '%s' belongs to drive '%s' on %s already; an address "
			"of its own for each drive of a bus",
			drive->address, bus->name, other->name,
			db_messages_name_line(&load->messages, other->source_line).text);
}

/* A drive without an axis key, though there are others at the same address. */
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
		db_messages_add_error(
			&load->messages, drive->source_line,
			"drive '%s' has no key 'axis', which must be given because drive '%s' is "
			"behind address %u of bus '%s' too; add axis = x, for instance",
			drive->name, other->name, drive->address, bus->name);
		return;
	}
}

static void check_drive(struct db_load *load, size_t index)
{
	const struct db_config *config = load->config;
	const struct db_drive_config *drive = &config->drives[index];
	size_t errors = load->messages.errors;
	unsigned gateway_unit = gateway_unit_of(config, drive->endpoint);

	if (drive->unit != 0 && drive->unit == gateway_unit)
		db_messages_add_error(&load->messages, drive_line(load, drive, "unit"),
		                      "unit = %u is the gateway's own unit (gateway-unit); another "
		                      "unit for one of them",
		                      drive->unit);
	if (drive->vendor_unit != 0 && drive->vendor_unit == gateway_unit)
		db_messages_add_error(&load->messages, drive_line(load, drive, "vendor-unit"),
		                      "vendor-unit = %u is the gateway's own unit (gateway-unit); "
		                      "another unit for one of them",
		                      drive->vendor_unit);
	if (drive->bus < config->bus_count)
		check_axis_given(load, index);
	check_vendor_unit(load, drive, drive);
	/* One message is enough: a drive that was copied a thousand times collides as often. */
	for (size_t i = 0; i < index && load->messages.errors == errors; i++) {
		const struct db_drive_config *other = &config->drives[i];

		if (drive->unit != 0 && drive->unit == other->unit &&
		    drive->endpoint == other->endpoint)
			db_messages_add_error(
				&load->messages, drive_line(load, drive, "unit"),
				"unit = %u belongs to drive '%s' on %s already; a unit of its own "
				"for each drive%s%s",
				drive->unit, other->name,
				db_messages_name_line(&load->messages, other->source_line).text,
				drive->endpoint_name ? " of endpoint " : "",
				drive->endpoint_name ? drive->endpoint_name : "");
		check_vendor_unit(load, drive, other);
		/* The later drive's unit against the second unit of an earlier one. */
		if (drive->vendor_unit != other->vendor_unit)
			check_vendor_unit(load, other, drive);
		if (drive->bus < config->bus_count && drive->bus == other->bus)
			check_addresses(load, drive, other);
	}
}

/* --- interfaces that buses share -------------------------------------------------------------- */

/*
 * Several buses on one CAN interface: allowed when no frame can be meant for both, because then
 * each of them sees only its own. Otherwise one would take the other's frames for answers.
 */
struct filter_list {
	struct db_can_filter filters[DB_FILTERS_MAX];
	size_t count;
};

static struct filter_list filters_of(const struct db_bus_config *bus)
{
	struct filter_list list = { .count = 0 };

	if (bus->driver->filters)
		list.count = bus->driver->filters(bus, list.filters);
	return list;
}

/* True if an id passes a filter of each; a bus without filters sees every frame. */
static bool filters_collide(const struct filter_list *list, const struct filter_list *others)
{
	for (size_t i = 0; i < list->count; i++) {
		for (size_t j = 0; j < others->count; j++) {
			const struct db_can_filter *a = &list->filters[i];
			const struct db_can_filter *b = &others->filters[j];

			if (((a->id ^ b->id) & a->mask & b->mask) == 0)
				return true;
		}
	}
	return list->count == 0 || others->count == 0;
}

static void check_pair(struct db_load *load, const struct db_bus_config *bus,
                       const struct db_bus_config *other)
{
	struct filter_list filters = filters_of(bus), others = filters_of(other);

	if (filters_collide(&filters, &others))
		db_messages_add_error(
			&load->messages,
			db_section_find_line(load, "bus", bus->name, bus->source_line, "interface"),
			"buses '%s' (%s) and '%s' (%s, %s) use the same ids on interface %s, so "
			"that one could take the other's frames for its own; another interface for "
			"one of them%s",
			bus->name, bus->driver->name, other->name, other->driver->name,
			db_messages_name_line(&load->messages, other->source_line).text,
			bus->interface,
			bus->driver == other->driver ? ", or one bus for all their drives" : "");
	else if (bus->bitrate != other->bitrate)
		db_messages_add_error(
			&load->messages,
			db_section_find_line(load, "bus", bus->name, bus->source_line, "bitrate"),
			"bus '%s' has %u bit/s, but bus '%s' on %s has %u bit/s on the same "
			"interface %s; the same bitrate for both",
			bus->name, bus->bitrate, other->name,
			db_messages_name_line(&load->messages, other->source_line).text,
			other->bitrate, bus->interface);
}

static void check_interfaces(struct db_load *load)
{
	const struct db_config *config = load->config;

	for (size_t i = 0; i < config->bus_count; i++) {
		const struct db_bus_config *bus = &config->buses[i];

		for (size_t j = 0; j < i && bus->interface; j++) {
			const struct db_bus_config *other = &config->buses[j];

			if (other->interface && strcmp(bus->interface, other->interface) == 0)
				check_pair(load, bus, other);
		}
	}
}

/* --- what only the families know -------------------------------------------------------------- */

#define KEY_LENGTH_MAX 63

/* Messages of a bus's family. */
struct complaints {
	struct db_load *load;
	const struct db_bus_config *bus;
};

static void add_complaint(void *context, const struct db_drive_config *drive, bool error,
                          const char *format, ...) __attribute__((format(printf, 4, 5)));

static void add_complaint(void *context, const struct db_drive_config *drive, bool error,
                          const char *format, ...)
{
	struct complaints *complaints = context;
	struct db_messages *messages = &complaints->load->messages;
	unsigned line = drive ? drive->source_line : complaints->bus->source_line;
	char key[KEY_LENGTH_MAX + 1];
	size_t key_length;
	va_list arguments;
	char *text;
	int length;

	va_start(arguments, format);
	length = vasprintf(&text, format, arguments);
	va_end(arguments);
	if (length < 0) {
		db_messages_add_error(messages, 0, "out of memory; free some and try again");
		return;
	}
	/* A message that begins with a key of the section is about that key's line. */
	key_length = strcspn(text, " ");
	if (key_length <= KEY_LENGTH_MAX) {
		memcpy(key, text, key_length);
		key[key_length] = '\0';
		line = db_section_find_line(complaints->load, drive ? "drive" : "bus",
		                            drive ? drive->name : complaints->bus->name, line, key);
	}
	if (error)
		db_messages_add_error(messages, line, "%s", text);
	else
		db_messages_add_warning(messages, line, "%s", text);
	free(text);
}

static void check_families(struct db_load *load)
{
	const struct db_config *config = load->config;
	/* One more than needed: calloc() of nothing may give null. */
	const struct db_drive_config **drives = calloc(config->drive_count + 1, sizeof(*drives));

	if (!drives) {
		db_messages_add_error(&load->messages, 0, "out of memory; free some and try again");
		return;
	}
	for (size_t i = 0; i < config->bus_count; i++) {
		struct complaints complaints = { .load = load, .bus = &config->buses[i] };
		size_t count = 0;

		if (!complaints.bus->driver->check_config)
			continue;
		for (size_t j = 0; j < config->drive_count; j++) {
			if (config->drives[j].bus == i)
				drives[count++] = &config->drives[j];
		}
		complaints.bus->driver->check_config(complaints.bus, drives, count, add_complaint,
		                                     &complaints);
	}
	free(drives);
}

void db_check(struct db_load *load)
{
	check_devices(load);
	for (size_t i = 0; i < load->config->modbus.line_count; i++)
		check_line_device(load, i);
	for (size_t i = 0; i < load->config->modbus.endpoint_count; i++)
		check_endpoint(load, i);
	if (load->config->modbus.endpoint_count > DB_ENDPOINTS_MAX)
		db_messages_add_error(&load->messages,
		                      load->config->modbus.endpoints[DB_ENDPOINTS_MAX].source_line,
		                      "there are %zu sections endpoint; at most %d",
		                      load->config->modbus.endpoint_count, DB_ENDPOINTS_MAX);
	db_doors_check(load);
	for (size_t i = 0; i < load->config->drive_count; i++)
		check_drive(load, i);
	/* From here on everything must be there. */
	if (load->messages.errors == 0)
		check_interfaces(load);
	if (load->messages.errors == 0)
		db_times_fill(load);
	if (load->messages.errors == 0)
		check_families(load);
	if (load->messages.errors == 0)
		db_times_check(load);
	for (size_t i = 0; load->messages.errors == 0 && i < load->config->modbus.line_count; i++)
		check_line(load, &load->config->modbus.lines[i]);
	for (size_t i = 0; load->messages.errors == 0 && i < load->config->modbus.endpoint_count;
	     i++)
		warn_of_no_drives(load, &load->config->modbus.endpoints[i]);
}
