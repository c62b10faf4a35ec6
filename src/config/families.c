/* SPDX-License-Identifier: Apache-2.0 */
/* What only the families know of a configuration, put where it belongs in the file. */
#include "config/keys.h"
#include "config/load.h"
#include "drivebridge/driver.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define KEY_LENGTH_MAX 63

/* Of the bus whose family is asked. */
struct complaints {
	struct db_load *load;
	const struct db_bus_config *bus;
};

/* A message that begins with a key of the section is about that key's line. */
static unsigned line_of(const struct complaints *complaints, const struct db_drive_config *drive,
                        const char *text)
{
	const char *section = drive ? "drive" : "bus";
	const char *title = drive ? drive->name : complaints->bus->name;
	unsigned head = drive ? drive->source_line : complaints->bus->source_line;
	size_t length = strcspn(text, " ");
	char key[KEY_LENGTH_MAX + 1];

	if (length > KEY_LENGTH_MAX)
		return head;
	memcpy(key, text, length);
	key[length] = '\0';
	return db_load_line(complaints->load, section, title, head, key);
}

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...) __attribute__((format(printf, 4, 5)));

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...)
{
	struct complaints *complaints = context;
	struct db_report *report = &complaints->load->report;
	va_list arguments;
	char *text;
	int length;

	va_start(arguments, format);
	length = vasprintf(&text, format, arguments);
	va_end(arguments);
	if (length < 0) {
		db_report_error(report, 0, "out of memory; free some and try again");
		return;
	}
	if (error)
		db_report_error(report, line_of(complaints, drive, text), "%s", text);
	else
		db_report_warning(report, line_of(complaints, drive, text), "%s", text);
	free(text);
}

void db_load_check_families(struct db_load *load)
{
	const struct db_config *config = load->config;
	/* One more than needed: calloc() of nothing may give null. */
	const struct db_drive_config **drives = calloc(config->drive_count + 1, sizeof(*drives));

	if (!drives) {
		db_report_error(&load->report, 0, "out of memory; free some and try again");
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
		complaints.bus->driver->check_config(complaints.bus, drives, count, complain,
		                                     &complaints);
	}
	free(drives);
}
