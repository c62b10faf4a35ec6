/* SPDX-License-Identifier: Apache-2.0 */
/* A bus section: the family, the way to the bus, its place and speed, and the rest. */
#include "codec/slcan.h"
#include "config/keys.h"
#include "config/load.h"
#include "config/text.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"
#include "transport/serial.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SLCAN_BAUD 115200 /* of the adapter's serial port; many adapters do not care at all */
#define LIST_MAX 256

/* Appends to a list in a text, as far as it fits. */
static void add_to_list(char list[LIST_MAX], const char *name)
{
	size_t used = strlen(list);

	snprintf(list + used, LIST_MAX - used, "%s%s", used > 0 ? ", " : "", name);
}

/* --- family and transport ---------------------------------------------------------------------- */

static const struct db_driver *read_protocol(const struct db_section *section)
{
	const struct db_driver *const *drivers = section->load->built_in->drivers;
	char *name = db_section_text(section, "protocol");
	const struct db_driver *driver = NULL;
	char known[LIST_MAX] = "";

	for (size_t i = 0; name && !driver && drivers[i]; i++) {
		if (strcmp(drivers[i]->name, name) == 0)
			driver = drivers[i];
		add_to_list(known, drivers[i]->name);
	}
	if (name && !driver)
		db_report_error(&section->load->report, db_section_line(section, "protocol"),
		                "unknown protocol '%s'; known are: %s", name, known);
	free(name);
	return driver;
}

/* Name of the transport that is asked for; "" when that is wrong, which is reported. */
static const char *transport_name(const struct db_section *section, const struct db_driver *driver)
{
	size_t errors = db_report_errors(&section->load->report);

	if (!db_section_has(section, "transport"))
		return driver->medium == DB_MEDIUM_CAN ? "socketcan" : "serial";
	db_section_word(section, "transport");
	if (db_report_errors(&section->load->report) > errors)
		return "";
	return cfg_getstr(section->values, "transport");
}

static void report_transport(const struct db_section *section, const struct db_driver *driver,
                             const char *name, bool built_in)
{
	const struct db_transport *const *all = section->load->built_in->transports;
	char fitting[LIST_MAX] = "";

	for (; *all; all++) {
		if ((*all)->medium == driver->medium)
			add_to_list(fitting, (*all)->name);
	}
	if (built_in)
		db_report_error(&section->load->report, db_section_line(section, "transport"),
		                "transport = %s does not fit %s, which runs on %s; one of: %s",
		                name, driver->name,
		                driver->medium == DB_MEDIUM_CAN ? "CAN" : "a serial line", fitting);
	else
		db_report_error(&section->load->report, db_section_line(section, "transport"),
		                "transport %s is not built in; of those that fit %s there are: %s",
		                name, driver->name, fitting[0] ? fitting : "none");
}

/* Null when it is wrong, which is reported, or cannot be told. */
static const struct db_transport *read_transport(const struct db_section *section,
                                                 const struct db_driver *driver)
{
	const struct db_transport *const *all = section->load->built_in->transports;
	const char *name;

	if (!driver) {
		db_section_word(section, "transport");
		return NULL;
	}
	name = transport_name(section, driver);
	if (name[0] == '\0')
		return NULL;
	for (; *all; all++) {
		if (strcmp((*all)->name, name) != 0)
			continue;
		if ((*all)->medium == driver->medium)
			return *all;
		break;
	}
	report_transport(section, driver, name, *all != NULL);
	return NULL;
}

/* --- where the bus is -------------------------------------------------------------------------- */

/* What the kernel takes as the name of an interface. */
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

static void report_no_place(const struct db_section *section, const struct db_bus_config *bus)
{
	struct db_report *report = &section->load->report;

	if (bus->transport && bus->transport->uses_interface)
		db_report_error(
			report, section->line,
			"bus '%s' has neither 'interface' nor 'device'; add interface = \"can0\" for a CAN interface of the machine, or transport = slcan and device = \"/dev/ttyACM0\" for a CAN adapter on a serial port",
			section->title);
	else
		db_report_error(
			report, section->line,
			"bus '%s' has no key 'device', which must be given; add device = \"/dev/ttyUSB0\", the path of the serial port",
			section->title);
}

/* One of interface and device was given, but it is the wrong one, or both. */
static void check_place(const struct db_section *section, const struct db_bus_config *bus)
{
	struct db_report *report = &section->load->report;

	if (bus->transport->uses_interface && bus->device)
		db_report_error(
			report, db_section_line(section, "device"),
			"device = %s is for serial ports, but bus '%s' has transport = %s; set transport = slcan if a CAN adapter is on this port, else remove it%s",
			bus->device, section->title, bus->transport->name,
			bus->interface ? "" : " and give interface = \"can0\"");
	else if (!bus->transport->uses_interface && bus->interface &&
	         bus->transport->medium == DB_MEDIUM_CAN)
		db_report_error(
			report, db_section_line(section, "interface"),
			"interface = %s is for transport = socketcan, but bus '%s' has transport = %s; set transport = socketcan, or remove it%s",
			bus->interface, section->title, bus->transport->name,
			bus->device ? "" : " and give device = \"/dev/ttyACM0\"");
}

static void read_place(const struct db_section *section, struct db_bus_config *bus)
{
	struct db_report *report = &section->load->report;
	bool given = db_section_has(section, "device") || db_section_has(section, "interface");

	if (db_section_has(section, "device"))
		bus->device = db_section_text(section, "device");
	if (db_section_has(section, "interface"))
		bus->interface = db_section_text(section, "interface");
	if (bus->device && bus->device[0] != '/')
		db_report_error(
			report, db_section_line(section, "device"),
			"device = %s is no whole path; one that begins with /, such as /dev/ttyUSB0",
			bus->device);
	if (bus->interface && !is_interface_name(bus->interface))
		db_report_error(
			report, db_section_line(section, "interface"),
			"interface = %s is no name of a network interface; 1 to 15 characters without / : and spaces, such as can0",
			bus->interface);
	/* Without a transport there was a message already, and what is missing depends on it. */
	if (!given && (bus->transport || !bus->driver))
		report_no_place(section, bus);
	else if (bus->transport)
		check_place(section, bus);
}

/* --- how fast ---------------------------------------------------------------------------------- */

static void check_slcan_bitrate(const struct db_section *section, unsigned bitrate)
{
	char rates[LIST_MAX] = "";

	if (slcan_bitrate_digit(bitrate) >= 0)
		return;
	for (unsigned digit = 0; slcan_bitrate(digit) > 0; digit++) {
		char rate[16];

		snprintf(rate, sizeof(rate), "%lu", (unsigned long)slcan_bitrate(digit));
		add_to_list(rates, rate);
	}
	db_report_error(
		&section->load->report, db_section_line(section, "bitrate"),
		"bitrate = %u is none that a CAN adapter with transport = slcan can be set to; one of: %s",
		bitrate, rates);
}

static void read_speed(const struct db_section *section, struct db_bus_config *bus)
{
	const struct db_transport *transport = bus->transport;
	size_t errors = db_report_errors(&section->load->report);

	bus->baud = db_section_number(section, "baud");
	bus->bitrate = db_section_number(section, "bitrate");
	if (!transport || db_report_errors(&section->load->report) > errors)
		return;
	if (transport->uses_interface && db_section_has(section, "baud"))
		db_report_error(
			&section->load->report, db_section_line(section, "baud"),
			"baud is for serial ports, but bus '%s' has transport = %s; remove it, the speed of a CAN bus is bitrate",
			section->title, transport->name);
	if (transport->medium == DB_MEDIUM_SERIAL) {
		if (bus->baud == 0)
			bus->baud = bus->driver->default_baud;
		bus->bitrate = 0;
		return;
	}
	if (bus->baud == 0 && !transport->uses_interface)
		bus->baud = SLCAN_BAUD;
	if (bus->bitrate == 0)
		bus->bitrate = bus->driver->default_baud;
	if (strcmp(transport->name, "slcan") == 0)
		check_slcan_bitrate(section, bus->bitrate);
}

/* --- its line ---------------------------------------------------------------------------------- */

static void read_line(const struct db_section *section, struct db_bus_config *bus)
{
	static const char *const delays[] = { "rts-before-ms", "rts-after-ms" };
	struct db_report *report = &section->load->report;

	bus->parity = (enum db_parity)db_section_word(section, "parity");
	bus->stop_bits = db_section_number(section, "stop-bits");
	bus->line = (enum db_line)db_section_word(section, "line");
	bus->direction = (enum db_direction)db_section_word(section, "direction");
	bus->rts_before_ms = db_section_number(section, "rts-before-ms");
	bus->rts_after_ms = db_section_number(section, "rts-after-ms");
	if (bus->direction != DB_DIRECTION_ADAPTER) {
		if (bus->line == DB_LINE_RS232)
			db_report_error(
				report, db_section_line(section, "direction"),
				"direction is for RS485, but bus '%s' has line = rs232; remove one of them",
				section->title);
		return;
	}
	for (size_t i = 0; i < sizeof delays / sizeof delays[0]; i++) {
		if (db_section_number(section, delays[i]) != 0)
			db_report_warning(report, db_section_line(section, delays[i]),
			                  "%s does nothing without direction = rts or rts-inverted",
			                  delays[i]);
	}
}

static void read_group_start(const struct db_section *section, struct db_bus_config *bus)
{
	bus->starts_by_broadcast = db_section_word(section, "group-start");
	if (bus->starts_by_broadcast && (!bus->driver->begin_all || bus->line == DB_LINE_RS232))
		db_report_error(
			&section->load->report, db_section_line(section, "group-start"),
			"group-start = broadcast, but bus '%s' has no frame for all drives; remove it",
			section->title);
}

/* In half characters, and in microseconds. Drives are slower than the 3.5 characters of Modbus RTU. */
#define TURNAROUND_HALF_CHARACTERS 7
#define TURNAROUND_LEAST 1000

static unsigned read_turnaround(const struct db_section *section, const struct db_bus_config *bus)
{
	db_time characters;

	if (!bus->driver || bus->driver->medium != DB_MEDIUM_SERIAL || bus->baud == 0)
		return 0;
	if (db_section_has(section, "turnaround-us"))
		return db_section_number(section, "turnaround-us");
	characters = db_serial_wire_time(bus, TURNAROUND_HALF_CHARACTERS) / 2 / DB_NS_PER_US;
	return characters > TURNAROUND_LEAST ? (unsigned)characters : TURNAROUND_LEAST;
}

/* --- its thread -------------------------------------------------------------------------------- */

/* The file may be checked on another machine than it is for: what is missing here is a warning. */
static void read_cpus(const struct db_section *section, struct db_bus_config *bus)
{
	struct db_report *report = &section->load->report;
	long here = sysconf(_SC_NPROCESSORS_CONF);
	char *text;

	text = db_section_text(section, "cpus");
	if (!text)
		return;
	if (!db_text_cpus(text, &bus->cpus))
		db_report_error(
			report, db_section_line(section, "cpus"),
			"cpus = %s is no list of processors; numbers from 0 to 63 and ranges of them with commas between, such as 3 or \"2-3,5\", or any",
			text);
	else if (here > 0 && here < 64 && bus->cpus >> here != 0)
		db_report_warning(
			report, db_section_line(section, "cpus"),
			"cpus = %s: this machine has only the processors 0 to %ld; the bus runs on those of the list that there are, or on any",
			text, here - 1);
	free(text);
}

/* --- all of it --------------------------------------------------------------------------------- */

void db_load_bus(struct db_load *load, unsigned index, struct db_bus_config *bus)
{
	struct db_section section = db_section_open(load, "bus", index);

	bus->name = strdup(section.title);
	bus->source_line = section.line;
	bus->driver = read_protocol(&section);
	bus->transport = read_transport(&section, bus->driver);
	read_place(&section, bus);
	read_speed(&section, bus);
	read_line(&section, bus);
	read_group_start(&section, bus);
	bus->turnaround_us = read_turnaround(&section, bus);
	bus->cycle_ms = db_section_number(&section, "cycle-ms");
	bus->drive_latency_ms = db_section_number(&section, "drive-latency-ms");
	bus->retries = db_section_number(&section, "retries");
	bus->queue = db_section_number(&section, "queue");
	bus->save_interval_s = db_section_number(&section, "save-interval-s");
	bus->priority = db_section_number(&section, "priority");
	read_cpus(&section, bus);
	bus->log = (enum db_log_level)(DB_LOG_ERROR + db_section_word(&section, "log"));
	db_section_options(&section, bus->driver, bus->options);
}
