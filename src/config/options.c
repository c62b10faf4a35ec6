/* SPDX-License-Identifier: Apache-2.0 */
/* What only some families have: their options, and keys that are for families of another kind. */
#include "config/keys.h"
#include "config/load.h"
#include "drivebridge/driver.h"

#include <math.h>
#include <string.h>

/* What to do with a key of the table that is not for this family. */
static const char *advice(const char *name)
{
	if (strcmp(name, "interface") == 0)
		return "remove it and name the port with device";
	if (strcmp(name, "bitrate") == 0)
		return "remove it and set the speed with baud";
	return "remove it";
}

static void refuse_key(const struct db_section *section, const struct db_outline_key *key,
                       enum db_config_scope scope, const struct db_driver *driver)
{
	struct db_report *report = &section->load->report;

	if (scope == DB_KEY_FOR_AXES)
		db_report_error(
			report, key->line,
			"%s is for multi-axis families, but %s has one axis behind an address; %s",
			key->name, driver->name, advice(key->name));
	else if (scope == DB_KEY_FOR_VSMD)
		db_report_error(
			report, key->line,
			"%s is for VSMD families, whose vendor has a register map of its own, but drive '%s' is of family %s; %s",
			key->name, section->title, driver->name, advice(key->name));
	else
		db_report_error(report, key->line, "%s is for %s families, but %s runs on %s; %s",
		                key->name, scope == DB_KEY_FOR_CAN ? "CAN" : "serial", driver->name,
		                scope == DB_KEY_FOR_CAN ? "a serial line" : "CAN",
		                advice(key->name));
}

static void check_key(const struct db_section *section, const struct db_outline_key *key,
                      const struct db_driver *driver)
{
	const struct db_config_key *common = db_config_key_find(section->name, key->name);
	char families[DB_FAMILIES_TEXT_MAX];

	if (common) {
		if (!db_config_key_fits(common, driver))
			refuse_key(section, key, common->scope, driver);
		return;
	}
	if (db_config_option_find(driver, section->name, key->name))
		return;
	db_config_option_families(section->load->built_in->drivers, section->name, key->name,
	                          families);
	db_report_error(&section->load->report, key->line,
	                "%s is a key of %s, but %s '%s' is of family %s; remove it", key->name,
	                families, section->name, section->title, driver->name);
}

void db_section_options(const struct db_section *section, const struct db_driver *driver,
                        double options[DB_OPTIONS_MAX])
{
	const struct db_outline *outline = &section->load->outline;

	for (size_t i = 0; i < DB_OPTIONS_MAX; i++)
		options[i] = NAN;
	if (!driver)
		return;
	for (size_t i = 0; i < outline->key_count; i++) {
		if (outline->keys[i].section == section->place && !outline->keys[i].refused)
			check_key(section, &outline->keys[i], driver);
	}
	for (size_t i = 0; i < driver->option_count && i < DB_OPTIONS_MAX; i++) {
		if (strcmp(driver->options[i].section, section->name) == 0)
			options[i] = db_section_option(section, &driver->options[i]);
	}
}
