/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"

#include "codec/slcan.h"
#include "config/keys.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"
#include "transport/serial.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#define SLCAN_BAUD 115200 /* speed of the adapter's serial port; many adapters ignore it */
#define LIST_MAX 256

/* Values that no file gives. */
#define PIPELINED 16
#define FRAME_TIMEOUT_MS 1000
#define QUEUE 32

static void check_socket_path(const struct db_section *section, const char *name, const char *path,
                              const char *usual)
{
	if (path && path[0] != '/' && strcmp(path, DB_NO_SOCKET) != 0)
		db_messages_add_error(
			&section->load->messages, db_section_line(section, name),
			"%s = %s is no whole path; one that begins with /, such as %s, or off",
			name, path, usual);
}

/* --- modbus ----------------------------------------------------------------------------------- */

static void read_modbus(struct db_load *load)
{
	struct db_modbus_config *modbus = &load->config->modbus;
	struct db_section section = db_section_open_only(load, "modbus");

	db_section_read(&section, modbus);
	modbus->max_pipelined = PIPELINED;
	modbus->frame_timeout_ms = FRAME_TIMEOUT_MS;
	check_socket_path(&section, "secure-socket", modbus->secure_socket,
	                  "/run/drivebridge/modbus");
	/* Whoever may run a program here could pass anybody's bytes on. */
	if (modbus->require_secure != DB_SECURE_NOT_REQUIRED && modbus->everybody_writes_here)
		db_messages_add_error(&load->messages, db_section_line(&section, "require-secure"),
		                      "require-secure = %s does not go with local-writers = "
		                      "everybody, with which any program on this machine gives "
		                      "others its right to write; local-writers = command-group",
		                      db_section_text(&section, "require-secure"));
	/* Readers need a place, too; writers can use every one. */
	if (modbus->max_clients == 0 || modbus->reserved_writers < modbus->max_clients)
		return;
	if (db_section_has(&section, "reserved-writers"))
		db_messages_add_error(&load->messages,
		                      db_section_line(&section, "reserved-writers"),
		                      "reserved-writers = %u leaves none of max-clients = %u to "
		                      "clients that may only read; fewer than that",
		                      modbus->reserved_writers, modbus->max_clients);
	modbus->reserved_writers = modbus->max_clients - 1;
}

/* --- endpoints -------------------------------------------------------------------------------- */

/* A copy, to be freed; null when out of memory. */
static struct db_network *copy_networks(const struct db_network *networks, size_t count)
{
	struct db_network *copy = calloc(count + 1, sizeof(*copy));

	if (copy && count > 0)
		memcpy(copy, networks, count * sizeof(*copy));
	return copy;
}

/* After the section modbus. False when out of memory. */
static bool read_endpoint(struct db_load *load, size_t index, struct db_endpoint_config *endpoint)
{
	const struct db_modbus_config *modbus = &load->config->modbus;
	struct db_section section = db_section_open(load, index);

	endpoint->name = strdup(section.title);
	endpoint->number = db_endpoint_number(section.title);
	endpoint->source_line = section.line;
	db_section_read(&section, endpoint);
	check_socket_path(&section, "secure-socket", endpoint->secure_socket,
	                  "/run/drivebridge/modbus");
	if (!db_section_has(&section, "allow-read")) {
		endpoint->allow_read_count = modbus->allow_read_count;
		endpoint->allow_read = copy_networks(modbus->allow_read, modbus->allow_read_count);
	}
	if (!db_section_has(&section, "allow-write")) {
		endpoint->allow_write_count = modbus->allow_write_count;
		endpoint->allow_write = copy_networks(modbus->allow_write,
		                                      modbus->allow_write_count);
	}
	if (!db_section_has(&section, "max-clients"))
		endpoint->max_clients = modbus->max_clients;
	endpoint->reserved_writers = modbus->reserved_writers;
	if (endpoint->max_clients > 0 && endpoint->reserved_writers >= endpoint->max_clients)
		endpoint->reserved_writers = endpoint->max_clients - 1;
	return endpoint->name && endpoint->allow_read && endpoint->allow_write;
}

/* The number of the endpoint that the key names; the first one's when it is not given. */
static uint32_t find_endpoint(const struct db_section *section, const char *name)
{
	const struct db_modbus_config *modbus = &section->load->config->modbus;

	for (size_t i = 0; name && i < modbus->endpoint_count; i++) {
		if (strcmp(modbus->endpoints[i].name, name) == 0)
			return modbus->endpoints[i].number;
	}
	if (name)
		db_messages_add_error(
			&section->load->messages, db_section_line(section, "endpoint"),
			"there is no endpoint '%s'; the name of a section \"endpoint %s { ... }\" "
			"of this file, or no key endpoint for the units of modbus",
			name, name);
	return DB_ENDPOINT_FIRST;
}

/* --- control ---------------------------------------------------------------------------------- */

static void read_control(struct db_load *load)
{
	struct db_control_config *control = &load->config->control;
	struct db_section section = db_section_open_only(load, "control");

	db_section_read(&section, control);
	check_socket_path(&section, "socket", control->socket, "/run/drivebridge/control");
}

/* --- roles ------------------------------------------------------------------------------------ */

static void check_drive_names(const struct db_section *section, const char *key,
                              const struct db_drive_set *set)
{
	const struct db_config *config = section->load->config;

	for (const char *name = set->names; name && *name; name += strlen(name) + 1) {
		size_t i = 0;

		while (i < config->drive_count && strcmp(config->drives[i].name, name) != 0)
			i++;
		if (i == config->drive_count)
			db_messages_add_error(&section->load->messages,
			                      db_section_line(section, key),
			                      "%s of role '%s' names '%s', but there is no drive "
			                      "'%s'; correct the name, or add the drive",
			                      key, section->title, name, name);
	}
}

/* After the drives. False when out of memory. */
static bool read_role(struct db_load *load, size_t index, struct db_role_config *role)
{
	struct db_section section = db_section_open(load, index);

	role->name = strdup(section.title);
	db_section_read(&section, role);
	check_drive_names(&section, "read", &role->read);
	check_drive_names(&section, "write", &role->write);
	return role->name;
}

/* --- serial lines of PLCs --------------------------------------------------------------------- */

/* After the roles. False when out of memory. */
static bool read_line(struct db_load *load, size_t index, struct db_rtu_config *line)
{
	static const uint8_t none[sizeof(line->units)];
	struct db_section section = db_section_open(load, index);
	const struct db_modbus_config *modbus = &load->config->modbus;

	line->name = strdup(section.title);
	line->source_line = section.line;
	db_section_read(&section, line);
	line->endpoint = find_endpoint(&section, line->endpoint_name);
	for (size_t i = 0; line->role_name && i < modbus->role_count; i++) {
		if (strcmp(modbus->roles[i].name, line->role_name) == 0)
			line->role = &modbus->roles[i];
	}
	if (line->role_name && !line->role)
		db_messages_add_error(&load->messages, db_section_line(&section, "role"),
		                      "there is no role '%s'; the name of a section \"role %s { "
		                      "... }\" of this file",
		                      line->role_name, line->role_name);
	if (memcmp(line->units, none, sizeof(none)) == 0 && !db_section_misread(&section, "units"))
		db_messages_add_error(&load->messages, db_section_line(&section, "units"),
		                      "line '%s' answers no unit; units = {\"1\", \"10-19\"}, for "
		                      "instance, or all",
		                      section.title);
	return line->name;
}

/* --- bus: family and transport ---------------------------------------------------------------- */

/* Appends to a list in a text, as far as it fits. */
static void add_to_list(char list[LIST_MAX], const char *name)
{
	size_t used = strlen(list);

	snprintf(list + used, LIST_MAX - used, "%s%s", used > 0 ? ", " : "", name);
}

/* Null when it is invalid. */
static const struct db_driver *read_protocol(const struct db_section *section)
{
	const struct db_driver *const *drivers = section->load->built_in->drivers;
	const char *name = db_section_text(section, "protocol");
	char known[LIST_MAX] = "";

	if (!name)
		return NULL;
	for (; *drivers; drivers++) {
		if (strcmp((*drivers)->name, name) == 0)
			return *drivers;
		add_to_list(known, (*drivers)->name);
	}
	db_messages_add_error(&section->load->messages, db_section_line(section, "protocol"),
	                      "unknown protocol '%s'; known are: %s", name, known);
	return NULL;
}

/* Null when it is invalid, or unknown without a family. */
static const struct db_transport *read_transport(const struct db_section *section)
{
	const struct db_transport *const *all = section->load->built_in->transports;
	const struct db_driver *driver = section->driver;
	const struct db_transport *found = NULL;
	bool given = db_section_has(section, "transport");
	char fitting[LIST_MAX] = "";
	const char *name;
	unsigned position;

	if ((given && !db_section_word(section, "transport", &position)) || !driver)
		return NULL;
	name = given                           ? db_section_text(section, "transport") :
	       driver->medium == DB_MEDIUM_CAN ? "socketcan" :
	                                         "serial";
	for (; *all; all++) {
		if (strcmp((*all)->name, name) == 0)
			found = *all;
		if ((*all)->medium == driver->medium)
			add_to_list(fitting, (*all)->name);
	}
	if (found && found->medium == driver->medium)
		return found;
	if (found)
		db_messages_add_error(
			&section->load->messages, db_section_line(section, "transport"),
			"transport = %s does not fit %s, which runs on %s; one of: %s", name,
			driver->name, driver->medium == DB_MEDIUM_CAN ? "CAN" : "a serial line",
			fitting);
	else
		db_messages_add_error(
			&section->load->messages, db_section_line(section, "transport"),
			"transport %s is not built in; of those that fit %s there are: %s", name,
			driver->name, fitting[0] ? fitting : "none");
	return NULL;
}

/* --- bus: where it is ------------------------------------------------------------------------- */

/* True if the kernel accepts it as the name of an interface. */
static bool is_interface_name(const char *text)
{
	if (strcmp(text, ".") == 0 || strcmp(text, "..") == 0)
		return false;
	for (; *text; text++) {
		if (*text == '/' || *text == ':' || isspace((unsigned char)*text))
			return false;
	}
	return true;
}

/* A bus has either an interface or a device, as its transport needs it. */
static void check_port(const struct db_section *section, const struct db_bus_config *bus)
{
	struct db_messages *messages = &section->load->messages;
	const struct db_transport *transport = bus->transport;
	bool given = db_section_has(section, "device") || db_section_has(section, "interface");

	/* Without a transport there was a message already, and the required key depends on it. */
	if (!transport && (given || bus->driver))
		return;
	if (!given && transport && transport->uses_interface)
		db_messages_add_error(
			messages, section->line,
			"bus '%s' has neither 'interface' nor 'device'; add interface = \"can0\" "
			"for a CAN interface of the machine, or transport = slcan and device = "
			"\"/dev/ttyACM0\" for a CAN adapter on a serial port",
			section->title);
	else if (!given)
		db_messages_add_error(messages, section->line,
		                      "bus '%s' has no key 'device', which must be given; add "
		                      "device = \"/dev/ttyUSB0\", the path of the serial port",
		                      section->title);
	else if (transport->uses_interface && bus->device)
		db_messages_add_error(
			messages, db_section_line(section, "device"),
			"device = %s is for serial ports, but bus '%s' has transport = %s; set "
			"transport = slcan if a CAN adapter is on this port, else remove it%s",
			bus->device, section->title, transport->name,
			bus->interface ? "" : " and give interface = \"can0\"");
	else if (!transport->uses_interface && bus->interface && transport->medium == DB_MEDIUM_CAN)
		db_messages_add_error(
			messages, db_section_line(section, "interface"),
			"interface = %s is for transport = socketcan, but bus '%s' has transport = "
			"%s; set transport = socketcan, or remove it%s",
			bus->interface, section->title, transport->name,
			bus->device ? "" : " and give device = \"/dev/ttyACM0\"");
}

/* --- bus: how fast, and its line -------------------------------------------------------------- */

/* A misprint of a usual one looks like this; but a drive may have any. */
static void warn_of_unusual_baud(const struct db_section *section, unsigned baud)
{
	static const unsigned usual[] = {
		300,     600,     1200,    1800,    2400,    4800,    9600,    14400,
		19200,   28800,   38400,   56000,   57600,   76800,   115200,  128000,
		230400,  250000,  256000,  460800,  500000,  576000,  921600,  1000000,
		1152000, 1500000, 2000000, 2500000, 3000000, 3500000, 4000000,
	};

	for (size_t i = 0; i < sizeof(usual) / sizeof(usual[0]); i++) {
		if (baud == usual[i])
			return;
	}
	db_messages_add_warning(&section->load->messages, db_section_line(section, "baud"),
	                        "baud = %u is not one of the usual speeds; few adapters have it",
	                        baud);
}

/* A missing speed becomes the family's usual one; one that does not apply is 0. */
static void fill_speed(const struct db_section *section, struct db_bus_config *bus)
{
	const struct db_transport *transport = bus->transport;
	char rates[LIST_MAX] = "";
	char rate[16];

	if (!transport || db_section_misread(section, "baud") ||
	    db_section_misread(section, "bitrate"))
		return;
	if (!transport->uses_interface && bus->baud > 0)
		warn_of_unusual_baud(section, bus->baud);
	if (transport->uses_interface && db_section_has(section, "baud"))
		db_messages_add_error(&section->load->messages, db_section_line(section, "baud"),
		                      "baud is for serial ports, but bus '%s' has transport = %s; "
		                      "remove it, the speed of a CAN bus is bitrate",
		                      section->title, transport->name);
	if (transport->medium == DB_MEDIUM_SERIAL) {
		if (bus->baud == 0)
			bus->baud = bus->driver->default_baud;
		return;
	}
	if (bus->baud == 0 && !transport->uses_interface)
		bus->baud = SLCAN_BAUD;
	if (bus->bitrate == 0)
		bus->bitrate = bus->driver->default_baud;
	if (strcmp(transport->name, "slcan") == 0 && slcan_bitrate_digit(bus->bitrate) < 0) {
		for (unsigned digit = 0; slcan_bitrate(digit) > 0; digit++) {
			snprintf(rate, sizeof(rate), "%lu", (unsigned long)slcan_bitrate(digit));
			add_to_list(rates, rate);
		}
		db_messages_add_error(
			&section->load->messages, db_section_line(section, "bitrate"),
			"bitrate = %u is none that a CAN adapter with transport = slcan can "
			"be set to; one of: %s",
			bus->bitrate, rates);
	}
}

static void check_direction(const struct db_section *section, const struct db_bus_config *bus)
{
	struct db_messages *messages = &section->load->messages;

	if (bus->direction != DB_DIRECTION_ADAPTER && bus->line == DB_LINE_RS232)
		db_messages_add_error(
			messages, db_section_line(section, "direction"),
			"direction is for RS485, but bus '%s' has line = rs232; remove one of them",
			section->title);
	if (bus->direction != DB_DIRECTION_ADAPTER)
		return;
	if (bus->rts_before_ms != 0)
		db_messages_add_warning(
			messages, db_section_line(section, "rts-before-ms"),
			"rts-before-ms does nothing without direction = rts or rts-inverted");
	if (bus->rts_after_ms != 0)
		db_messages_add_warning(
			messages, db_section_line(section, "rts-after-ms"),
			"rts-after-ms does nothing without direction = rts or rts-inverted");
}

/* In half characters, and in microseconds. Drives are slower than the 3.5 characters of Modbus
 * RTU. */
#define TURNAROUND_HALF_CHARACTERS 7
#define TURNAROUND_LEAST 1000

/* False when out of memory. */
static bool read_bus(struct db_load *load, size_t index, struct db_bus_config *bus)
{
	struct db_section section = db_section_open(load, index);
	db_time characters;
	struct db_messages *messages = &load->messages;

	/* gcc's analyzer takes it for lost: db_config_free() frees it. */
	bus->name = strdup(section.title);
	bus->source_line = section.line;
	bus->driver = read_protocol(&section);
	section.driver = bus->driver;
	db_section_read(&section, bus);
	bus->queue = QUEUE;
	bus->options = db_section_read_options(&section);
	bus->transport = read_transport(&section);
	if (bus->device && bus->device[0] != '/')
		db_messages_add_error(messages, db_section_line(&section, "device"),
		                      "device = %s is no whole path; one that begins with /, such "
		                      "as /dev/ttyUSB0",
		                      bus->device);
	if (bus->interface && !is_interface_name(bus->interface))
		db_messages_add_error(messages, db_section_line(&section, "interface"),
		                      "interface = %s is no name of a network interface; 1 to 15 "
		                      "characters without / : and spaces, such as can0",
		                      bus->interface);
	check_port(&section, bus);
	fill_speed(&section, bus);
	check_direction(&section, bus);
	if (bus->driver && bus->driver->medium == DB_MEDIUM_SERIAL && bus->baud != 0 &&
	    !db_section_has(&section, "turnaround-us")) {
		characters = db_serial_wire_time(bus, TURNAROUND_HALF_CHARACTERS) / 2 /
		             DB_NS_PER_US;
		bus->turnaround_us = characters > TURNAROUND_LEAST ? (unsigned)characters :
		                                                     TURNAROUND_LEAST;
	}
	if (bus->starts_by_broadcast && bus->driver &&
	    (!bus->driver->begin_all || bus->line == DB_LINE_RS232))
		db_messages_add_error(messages, db_section_line(&section, "group-start"),
		                      "group-start = broadcast, but bus '%s' has no frame for all "
		                      "drives; remove it",
		                      section.title);
	return bus->name &&
	       db_profiles_note(load, index, false, (size_t)(bus - load->config->buses));
}

/* --- drive ------------------------------------------------------------------------------------ */

/* Index of the drive's bus; bus_count when there is none, which is reported. */
static size_t find_bus(const struct db_section *section)
{
	const struct db_config *config = section->load->config;
	const char *name = db_section_text(section, "bus");
	size_t index = 0;

	if (!name)
		return config->bus_count;
	while (index < config->bus_count && strcmp(config->buses[index].name, name) != 0)
		index++;
	if (index == config->bus_count)
		db_messages_add_error(&section->load->messages, db_section_line(section, "bus"),
		                      "there is no bus '%s'; the name of a section \"bus %s { ... "
		                      "}\" of this file",
		                      name, name);
	return index;
}

static void check_address(const struct db_section *section, const struct db_bus_config *bus,
                          unsigned address)
{
	struct db_messages *messages = &section->load->messages;
	const struct db_driver *driver = bus->driver;
	unsigned line = db_section_line(section, "address");
	/* A frame on an RS232 line needs no address, except that of a controller with axes, which
	 * always carries one. */
	bool addressed = driver->medium != DB_MEDIUM_SERIAL || bus->line != DB_LINE_RS232 ||
	                 driver->axes > 0;

	if (!addressed && address != 0)
		db_messages_add_error(messages, line,
		                      "address = %u cannot be on bus '%s', whose line is RS232; "
		                      "remove it, or set line = rs485 there",
		                      address, bus->name);
	else if (addressed && !db_section_has(section, "address"))
		db_messages_add_error(messages, section->line,
		                      "drive '%s' has no key 'address', which must be given on bus "
		                      "'%s'; add address = ..., a whole number from %u to %u",
		                      section->title, bus->name, driver->address_min,
		                      driver->address_max);
	else if (addressed && (address < driver->address_min || address > driver->address_max))
		db_messages_add_error(
			messages, line,
			"address = %u is out of range; %s drives have addresses from %u to %u",
			address, driver->name, driver->address_min, driver->address_max);
}

/* False when out of memory. */
static bool read_drive(struct db_load *load, size_t index, struct db_drive_config *drive)
{
	struct db_section section = db_section_open(load, index);
	struct db_messages *messages = &load->messages;
	const struct db_bus_config *bus = NULL;

	drive->name = strdup(section.title);
	drive->source_line = section.line;
	drive->bus = find_bus(&section);
	if (drive->bus < load->config->bus_count)
		bus = &load->config->buses[drive->bus];
	section.driver = bus ? bus->driver : NULL;
	db_section_read(&section, drive);
	drive->endpoint = find_endpoint(&section, drive->endpoint_name);
	drive->options = db_section_read_options(&section);
	if (bus && section.driver && !db_section_misread(&section, "address"))
		check_address(&section, bus, drive->address);
	if (section.driver && drive->axis >= section.driver->axes && drive->axis > 0) {
		/* Each name is one letter, followed by a space. */
		db_messages_add_error(messages, db_section_line(&section, "axis"),
		                      "axis = %s is not there; %s controllers have the axes %.*s",
		                      db_section_text(&section, "axis"), section.driver->name,
		                      (int)(2 * section.driver->axes - 1),
		                      db_keys_find("drive", "axis")->words);
		drive->axis = 0;
	}
	drive->counts_given = db_section_has(&section, "counts-per-unit");
	drive->unit_given = db_section_has(&section, "unit-name");
	if (!db_section_has(&section, "on-exit"))
		drive->on_exit = drive->on_client_loss;
	if (drive->min_position > drive->max_position)
		db_messages_add_error(
			messages, db_section_line(&section, "min-position"),
			"min-position = %g is above max-position = %g; the other way round",
			drive->min_position, drive->max_position);
	if (drive->vendor_layout && drive->vendor_unit != 0)
		db_messages_add_error(
			messages, db_section_line(&section, "vendor-unit"),
			"vendor-unit = %u gives the vendor's register map to a second unit, but "
			"layout = vsmd gives it to the drive's own; one of them",
			drive->vendor_unit);
	return drive->name && drive->options &&
	       db_profiles_note(load, index, true, (size_t)(drive - load->config->drives));
}

/* --- all of them ------------------------------------------------------------------------------ */

/* True if it is of this kind; never called for modbus and control. */
static bool is_section(const struct db_load *load, size_t index, const char *name)
{
	const struct db_reader_section *section = &load->reader.sections[index];

	return !section->refused && !section->profile && strcmp(section->name, name) == 0;
}

bool db_sections_read(struct db_load *load)
{
	struct db_config *config = load->config;
	size_t count = load->reader.section_count;
	size_t buses = 0;
	size_t drives = 0;
	size_t roles = 0;
	size_t lines = 0;
	size_t endpoints = 0;
	for (size_t i = 0; i < count; i++) {
		buses += is_section(load, i, "bus");
		drives += is_section(load, i, "drive");
		roles += is_section(load, i, "role");
		lines += is_section(load, i, "modbus-rtu");
		endpoints += is_section(load, i, "endpoint");
	}
	/* One more than needed: calloc() of nothing may give null. */
	config->buses = calloc(buses + 1, sizeof(*config->buses));
	config->drives = calloc(drives + 1, sizeof(*config->drives));
	config->modbus.roles = calloc(roles + 1, sizeof(*config->modbus.roles));
	config->modbus.lines = calloc(lines + 1, sizeof(*config->modbus.lines));
	config->modbus.endpoints = calloc(endpoints + 1, sizeof(*config->modbus.endpoints));
	if (!config->buses || !config->drives || !config->modbus.roles || !config->modbus.lines ||
	    !config->modbus.endpoints)
		return false;
	read_modbus(load);
	read_control(load);
	for (size_t i = 0; i < count; i++) {
		if (is_section(load, i, "endpoint") &&
		    !read_endpoint(load, i,
		                   &config->modbus.endpoints[config->modbus.endpoint_count++]))
			return false;
	}
	/* Drives may name buses that follow them. */
	for (size_t i = 0; i < count; i++) {
		if (is_section(load, i, "bus") &&
		    !read_bus(load, i, &config->buses[config->bus_count++]))
			return false;
	}
	for (size_t i = 0; i < count; i++) {
		if (is_section(load, i, "drive") &&
		    !read_drive(load, i, &config->drives[config->drive_count++]))
			return false;
	}
	for (size_t i = 0; i < count; i++) {
		if (is_section(load, i, "role") &&
		    !read_role(load, i, &config->modbus.roles[config->modbus.role_count++]))
			return false;
	}
	for (size_t i = 0; i < count; i++) {
		if (is_section(load, i, "modbus-rtu") &&
		    !read_line(load, i, &config->modbus.lines[config->modbus.line_count++]))
			return false;
	}
	return true;
}
