/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The families' own settings for tests that make configurations themselves: room for those of a bus
 * and of a drive, and their values by name. Header only; any thread.
 *
 *	struct fake_options options = { .bus = { 0 } };
 *
 *	fake_preset_options(driver, &options);
 *	fake_set_option(driver, &options, "reaction-ms", 50);
 *	bus.options = options.bus;
 *	drive.options = options.drive;
 */
#ifndef DRIVEBRIDGE_FAKES_OPTIONS_H
#define DRIVEBRIDGE_FAKES_OPTIONS_H

#include "drivebridge/driver.h"
#include "fakes/must.h"

#include <math.h>
#include <stdalign.h>
#include <stdlib.h>
#include <string.h>

#define FAKE_OPTIONS_SIZE 512

struct fake_options {
	alignas(double) unsigned char bus[FAKE_OPTIONS_SIZE];
	alignas(double) unsigned char drive[FAKE_OPTIONS_SIZE];
};

/* Its default in a configuration file: the place of a word, NAN for a number without one. */
static inline double fake_preset(const struct db_option *option)
{
	size_t length = strlen(option->preset);
	double place = 0.0;

	if (option->words[0] == '\0')
		return length > 0 ? strtod(option->preset, NULL) : (double)NAN;
	for (const char *word = option->words; word; word = strchr(word, ' '), place++) {
		word += *word == ' ';
		if (strncmp(word, option->preset, length) == 0 &&
		    (word[length] == ' ' || word[length] == '\0'))
			return place;
	}
	must_fail("the default is one of the words", __FILE__, __LINE__);
}

static inline void fake_put_option(const struct db_option *option, struct fake_options *options,
                                   double value)
{
	bool of_bus = strcmp(option->section, "bus") == 0;

	must(option->offset + sizeof value <= FAKE_OPTIONS_SIZE);
	db_option_set(option, of_bus ? options->bus : options->drive, value);
}

static inline void fake_set_option(const struct db_driver *driver, struct fake_options *options,
                                   const char *name, double value)
{
	size_t i = 0;

	while (i < driver->option_count && strcmp(driver->options[i].name, name) != 0)
		i++;
	must(i < driver->option_count);
	fake_put_option(&driver->options[i], options, value);
}

static inline void fake_preset_options(const struct db_driver *driver, struct fake_options *options)
{
	for (size_t i = 0; i < driver->option_count; i++)
		fake_put_option(&driver->options[i], options, fake_preset(&driver->options[i]));
}

#endif
