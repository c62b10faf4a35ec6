/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"

#include "config/names.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <malloc.h>
#include <stdlib.h>
#include <string.h>

const struct db_built_in db_load_built_in = { db_drivers, db_transports };

/* All steps from the texts to the configuration; mistakes are errors. */
static void read_sources(struct db_load *load)
{
	static const struct db_reader_rules rules = {
		.sections = "modbus, control, role NAME, bus NAME, drive NAME, modbus-rtu NAME or "
			    "endpoint NAME",
	};

	if (!db_reader_read(&load->reader, &rules, &load->messages))
		return;
	/* Users who may edit this file may change buses and drives, but not the rights of users. */
	for (size_t i = 0; i < load->reader.section_count; i++) {
		const struct db_reader_section *section = &load->reader.sections[i];
		const struct db_source *source = db_messages_find_source(&load->messages,
		                                                         section->line);

		if (source->edited && (strcmp(section->name, "modbus") == 0 ||
		                       strcmp(section->name, "control") == 0 ||
		                       strcmp(section->name, "endpoint") == 0 ||
		                       strcmp(section->name, "modbus-rtu") == 0 ||
		                       strcmp(section->name, "role") == 0))
			db_messages_add_error(
				&load->messages, section->line,
				"section %s is reserved to the files of root; a file that is "
				"edited over the page has sections bus and drive",
				section->name);
	}
	db_names_check(load->built_in->drivers, &load->reader, &load->messages);
	if (!db_profiles_read(load, &rules))
		return;
	if (db_sections_read(load))
		db_check(load);
	else
		db_messages_add_error(&load->messages, 0, "out of memory; free some and try again");
}

/* Sections then name their file and the line there, no longer the line in all files. */
static void name_places(struct db_config *config, const struct db_messages *messages)
{
	for (size_t i = 0; i < config->bus_count; i++) {
		struct db_bus_config *bus = &config->buses[i];
		const struct db_source *source = db_messages_find_source(messages,
		                                                         bus->source_line);

		bus->source_file = source->path;
		bus->source_line -= source->lines_before;
	}
	for (size_t i = 0; i < config->modbus.line_count; i++) {
		struct db_rtu_config *line = &config->modbus.lines[i];
		const struct db_source *source = db_messages_find_source(messages,
		                                                         line->source_line);

		line->source_file = source->path;
		line->source_line -= source->lines_before;
	}
	for (size_t i = 0; i < config->drive_count; i++) {
		struct db_drive_config *drive = &config->drives[i];
		const struct db_source *source = db_messages_find_source(messages,
		                                                         drive->source_line);

		drive->source_file = source->path;
		drive->source_line -= source->lines_before;
	}
}

/* Takes over the sources; `load` contains all other initial data. *copy, if not null, as in struct
 * db_config_reading. */
static int load_sources(struct db_load *load, struct db_source *sources, size_t count, FILE *errors,
                        struct db_config **config, char **copy)
{
	struct db_config *made = calloc(1, sizeof(*made));
	bool good;

	if (!made) {
		fprintf(errors, "%s: out of memory; free some and try again\n", sources[0].path);
		db_sources_free(sources, count);
		return -1;
	}
	load->messages = (struct db_messages){ .sources = sources, .source_count = count };
	load->config = made;
	made->sources = sources;
	made->source_count = count;
	read_sources(load);
	good = load->messages.errors == 0;
	db_messages_print(&load->messages, errors);
	if (good)
		name_places(made, &load->messages);
	if (good && copy)
		*copy = db_copy_write(made->sources, made->source_count);
	db_sources_forget_texts(made->sources, made->source_count);
	db_messages_clear(&load->messages);
	db_reader_clear(&load->reader);
	if (!good) {
		db_config_free(made);
		return -1;
	}
	*config = made;
	return 0;
}

int db_load_text(const struct db_built_in *built_in, const char *text, const char *file,
                 FILE *errors, struct db_config **config)
{
	struct db_source *source = db_sources_of_text(file, text);

	if (!source) {
		fprintf(errors, "%s: out of memory; free some and try again\n", file);
		return -1;
	}
	return db_load_sources(built_in, source, 1, errors, config);
}

int db_load_sources(const struct db_built_in *built_in, struct db_source *sources, size_t count,
                    FILE *errors, struct db_config **config)
{
	struct db_load load = { .built_in = built_in };
	size_t own = 0;
	int error;

	/* Profiles come last, and are read when a section names them. */
	while (own < count && !sources[own].profile)
		own++;
	load.offered_count = count - own;
	load.offered = calloc(load.offered_count + 1, sizeof(*load.offered));
	if (!load.offered) {
		fputs("the configuration: out of memory; free some and try again\n", errors);
		free(load.offered);
		db_sources_free(sources, count);
		return -1;
	}
	memcpy(load.offered, sources + own, load.offered_count * sizeof(*load.offered));
	error = load_sources(&load, sources, own, errors, config, NULL);
	free(load.profiles);
	db_sources_free(load.offered, load.offered_count);
	return error;
}

int db_config_read(const char *path, const char *edited, FILE *errors,
                   struct db_config_reading *reading)
{
	struct db_load load = { .built_in = &db_load_built_in, .path = path };
	struct db_source *sources;
	size_t count;
	int error;

	*reading = (struct db_config_reading){ 0 };
	load.signature = db_config_signature(path, NULL);
	if (db_files_read(path, edited, errors, &sources, &count) == 0) {
		error = load_sources(&load, sources, count, errors, &reading->config,
		                     &reading->copy);
	} else {
		db_sources_free(sources, count);
		error = -1;
	}
	reading->profiles = load.profiles;
	reading->signature = load.signature;
	/* The texts and what was read from them lie below the memory that stays: once memory is
	 * locked they would stay, too. */
	if (error == 0)
		malloc_trim(0);
	return error;
}

void db_config_reading_clear(struct db_config_reading *reading)
{
	db_config_free(reading->config);
	free(reading->copy);
	free(reading->profiles);
	*reading = (struct db_config_reading){ 0 };
}

int db_config_load(const char *path, FILE *errors, struct db_config **config)
{
	struct db_config_reading reading;
	int error = db_config_read(path, NULL, errors, &reading);

	if (error == 0)
		*config = reading.config;
	reading.config = NULL;
	db_config_reading_clear(&reading);
	return error;
}

void db_config_free(struct db_config *config)
{
	if (!config)
		return;
	free(config->modbus.listen);
	free(config->modbus.allow_read);
	free(config->modbus.allow_write);
	free(config->modbus.secure_socket);
	for (size_t i = 0; config->modbus.roles && i < config->modbus.role_count; i++) {
		free(config->modbus.roles[i].name);
		free(config->modbus.roles[i].read.names);
		free(config->modbus.roles[i].write.names);
	}
	free(config->modbus.roles);
	for (size_t i = 0; config->modbus.endpoints && i < config->modbus.endpoint_count; i++) {
		free(config->modbus.endpoints[i].name);
		free(config->modbus.endpoints[i].listen);
		free(config->modbus.endpoints[i].allow_read);
		free(config->modbus.endpoints[i].allow_write);
		free(config->modbus.endpoints[i].secure_socket);
	}
	free(config->modbus.endpoints);
	for (size_t i = 0; config->modbus.lines && i < config->modbus.line_count; i++) {
		free(config->modbus.lines[i].endpoint_name);
		free(config->modbus.lines[i].name);
		free(config->modbus.lines[i].device);
		free(config->modbus.lines[i].role_name);
	}
	free(config->modbus.lines);
	free(config->control.socket);
	free(config->control.read_group);
	free(config->control.act_group);
	for (size_t i = 0; config->buses && i < config->bus_count; i++) {
		free(config->buses[i].name);
		free(config->buses[i].device);
		free(config->buses[i].interface);
		free(config->buses[i].options);
	}
	for (size_t i = 0; config->drives && i < config->drive_count; i++) {
		free(config->drives[i].name);
		free(config->drives[i].endpoint_name);
		free(config->drives[i].unit_name);
		free(config->drives[i].options);
	}
	for (size_t i = 0; i < config->profile_use_count; i++)
		free(config->profile_uses[i].keys);
	free(config->profile_uses);
	free(config->buses);
	free(config->drives);
	db_sources_free(config->sources, config->source_count);
	free(config);
}
