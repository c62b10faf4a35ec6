/* SPDX-License-Identifier: Apache-2.0 */
/* A drive section: where the drive is, how it is called, and what it does when left alone. */
#include "config/keys.h"
#include "config/load.h"
#include "drivebridge/driver.h"

#include <stdlib.h>
#include <string.h>

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

/* A frame on an RS232 line needs no address, except that of a controller with axes, which always
 * carries one. */
static bool is_addressed(const struct db_bus_config *bus)
{
	return bus->driver->medium != DB_MEDIUM_SERIAL || bus->line != DB_LINE_RS232 ||
	       bus->driver->axes > 0;
}

static void check_address(const struct db_section *section, const struct db_bus_config *bus,
                          unsigned address)
{
	struct db_report *report = &section->load->report;
	const struct db_driver *driver = bus->driver;
	unsigned line = db_section_line(section, "address");

	if (!is_addressed(bus)) {
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

/* 0 when there is none or it is wrong, which is reported. */
static unsigned read_axis(const struct db_section *section, const struct db_driver *driver)
{
	unsigned axis;

	/* On other families the key was refused already. */
	if (driver && driver->axes == 0)
		return 0;
	axis = db_section_word(section, "axis");
	if (!driver || axis < driver->axes)
		return axis;
	/* Each name is one letter, with a space behind it. */
	db_report_error(&section->load->report, db_section_line(section, "axis"),
	                "axis = %s is not there; %s controllers have the axes %.*s",
	                cfg_getstr(section->values, "axis"), driver->name,
	                (int)(2 * driver->axes - 1), db_config_key_find("drive", "axis")->words);
	return 0;
}

/* As many as the family has, to be freed; null when out of memory. */
static double *read_options(const struct db_section *section, const struct db_driver *driver)
{
	double all[DB_OPTIONS_MAX];
	size_t count = driver ? driver->option_count : 0;
	/* One more than needed: calloc() of nothing may give null. */
	double *options = calloc(count + 1, sizeof *options);

	if (!options)
		return NULL;
	db_section_options(section, driver, all);
	memcpy(options, all, count * sizeof *options);
	return options;
}

/* What depends on the family. */
static void read_place(const struct db_section *section, const struct db_bus_config *bus,
                       struct db_drive_config *drive)
{
	size_t errors = db_report_errors(&section->load->report);
	const struct db_driver *driver = bus ? bus->driver : NULL;

	drive->address = db_section_number(section, "address");
	if (driver && db_report_errors(&section->load->report) == errors)
		check_address(section, bus, drive->address);
	drive->axis = read_axis(section, driver);
	drive->options = read_options(section, driver);
}

static void read_limits(const struct db_section *section, struct db_drive_config *drive)
{
	drive->min_position = db_section_real(section, "min-position");
	drive->max_position = db_section_real(section, "max-position");
	drive->max_velocity = db_section_real(section, "max-velocity");
	drive->max_acceleration = db_section_real(section, "max-acceleration");
	if (drive->min_position > drive->max_position)
		db_report_error(&section->load->report, db_section_line(section, "min-position"),
		                "min-position = %g is above max-position = %g; the other way round",
		                drive->min_position, drive->max_position);
}

/* On other families the keys were refused already. */
static void read_vendor_view(const struct db_section *section, struct db_drive_config *drive)
{
	drive->vendor_layout = db_section_word(section, "layout") != 0;
	drive->vendor_unit = db_section_number(section, "vendor-unit");
	drive->vendor_high_first = db_section_word(section, "vendor-word-order") != 0;
	if (drive->vendor_layout && drive->vendor_unit != 0)
		db_report_error(
			&section->load->report, db_section_line(section, "vendor-unit"),
			"vendor-unit = %u gives the vendor's register map to a second unit, but layout = vsmd gives it to the drive's own; one of them",
			drive->vendor_unit);
}

void db_load_drive(struct db_load *load, unsigned index, struct db_drive_config *drive)
{
	struct db_section section = db_section_open(load, "drive", index);
	const struct db_bus_config *bus = NULL;

	drive->name = strdup(section.title);
	drive->source_line = section.line;
	drive->bus = read_drive_bus(&section);
	if (drive->bus < load->config->bus_count)
		bus = &load->config->buses[drive->bus];
	read_place(&section, bus, drive);
	drive->unit = db_section_number(&section, "unit");
	drive->counts_per_unit = db_section_real(&section, "counts-per-unit");
	drive->counts_given = db_section_has(&section, "counts-per-unit");
	drive->unit_name = db_section_text(&section, "unit-name");
	drive->unit_given = db_section_has(&section, "unit-name");
	drive->on_client_loss = (enum db_on_loss)db_section_word(&section, "on-client-loss");
	drive->on_exit = db_section_has(&section, "on-exit") ?
	                         (enum db_on_loss)db_section_word(&section, "on-exit") :
	                         drive->on_client_loss;
	drive->stop_reaction_ms = db_section_number(&section, "stop-reaction-ms");
	drive->on_stop_failure = (enum db_on_stop_failure)db_section_word(&section,
	                                                                  "on-stop-failure");
	drive->watchdog_ms = db_section_number(&section, "watchdog-ms");
	drive->watchdog_feed = (enum db_watchdog_feed)db_section_word(&section, "watchdog-feed");
	read_limits(&section, drive);
	drive->in_position_window = db_section_real(&section, "in-position-window");
	drive->settling_ms = db_section_number(&section, "settling-ms");
	read_vendor_view(&section, drive);
}
