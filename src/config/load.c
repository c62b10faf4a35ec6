/* SPDX-License-Identifier: Apache-2.0 */
#include "config/load.h"

#include "config/check.h"
#include "config/copy.h"
#include "config/files.h"
#include "config/names.h"
#include "config/sections.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <malloc.h>
#include <stdlib.h>
#include <string.h>

const struct db_built_in db_load_built_in = { db_drivers, db_transports };

/* Everything between the texts and the configuration; what is wrong is an error. */
static void read_sources(struct db_load *load)
{
	static const struct db_reader_rules rules = {
		.sections = "modbus, control, bus NAME or drive NAME",
	};

	if (!db_reader_read(&load->reader, &rules, &load->messages))
		return;
	db_names_check(load->built_in->drivers, &load->reader, &load->messages);
	if (db_sections_read(load))
		db_check(load);
	else
		db_messages_add_error(&load->messages, 0, "out of memory; free some and try again");
}

/* Sections name their file and the line there, no longer the line of all files. */
static void name_places(struct db_config *config, const struct db_messages *messages)
{
	for (size_t i = 0; i < config->bus_count; i++) {
		struct db_bus_config *bus = &config->buses[i];
		const struct db_source *source = db_messages_find_source(messages,
		                                                         bus->source_line);

		bus->source_file = source->path;
		bus->source_line -= source->lines_before;
	}
	for (size_t i = 0; i < config->drive_count; i++) {
		struct db_drive_config *drive = &config->drives[i];
		const struct db_source *source = db_messages_find_source(messages,
		                                                         drive->source_line);

		drive->source_file = source->path;
		drive->source_line -= source->lines_before;
	}
}

/* Takes the sources over. */
static int load_sources(const struct db_built_in *built_in, struct db_source *sources, size_t count,
                        FILE *errors, struct db_config **config)
{
	struct db_config *made = calloc(1, sizeof(*made));
	struct db_load load = {
		.built_in = built_in,
		.messages = { .sources = sources, .source_count = count },
		.config = made,
	};
	bool good;

	if (!made) {
		fprintf(errors, "%s: out of memory; free some and try again\n", sources[0].path);
		db_sources_free(sources, count);
		return -1;
	}
	made->sources = sources;
	made->source_count = count;
	read_sources(&load);
	good = load.messages.errors == 0;
	db_messages_print(&load.messages, errors);
	if (good)
		name_places(made, &load.messages);
	db_sources_forget_texts(sources, count);
	db_messages_clear(&load.messages);
	db_reader_clear(&load.reader);
	if (!good) {
		db_config_free(made);
		return -1;
	}
	*config = made;
	return 0;
}

int db_load_text_with(const struct db_built_in *built_in, const char *text, const char *file,
                      FILE *errors, struct db_config **config)
{
	struct db_source *source = db_sources_of_text(file, text);

	if (!source) {
		fprintf(errors, "%s: out of memory; free some and try again\n", file);
		return -1;
	}
	return load_sources(built_in, source, 1, errors, config);
}

int db_load_text(const char *text, const char *file, FILE *errors, struct db_config **config)
{
	return db_load_text_with(&db_load_built_in, text, file, errors, config);
}

int db_load_sources(struct db_source *sources, size_t count, FILE *errors,
                    struct db_config **config)
{
	return load_sources(&db_load_built_in, sources, count, errors, config);
}

int db_config_load_with_copy(const char *path, FILE *errors, struct db_config **config, char **copy)
{
	struct db_source *sources;
	size_t count;
	char *made;

	if (db_files_read(path, errors, &sources, &count) != 0) {
		db_sources_free(sources, count);
		return -1;
	}
	made = copy ? db_copy_write(sources, count) : NULL;
	if (load_sources(&db_load_built_in, sources, count, errors, config) != 0) {
		free(made);
		return -1;
	}
	if (copy)
		*copy = made;
	/* The texts and what was read of them lie below what stays: once memory is locked they
	 * would stay, too. */
	malloc_trim(0);
	return 0;
}

int db_config_load(const char *path, FILE *errors, struct db_config **config)
{
	return db_config_load_with_copy(path, errors, config, NULL);
}

void db_config_free(struct db_config *config)
{
	if (!config)
		return;
	free(config->modbus.listen);
	free(config->modbus.allow_read);
	free(config->modbus.allow_write);
	free(config->control.socket);
	free(config->control.read_group);
	free(config->control.act_group);
	for (size_t i = 0; config->buses && i < config->bus_count; i++) {
		free(config->buses[i].name);
		free(config->buses[i].device);
		free(config->buses[i].interface);
	}
	for (size_t i = 0; config->drives && i < config->drive_count; i++) {
		free(config->drives[i].name);
		free(config->drives[i].unit_name);
		free(config->drives[i].options);
	}
	free(config->buses);
	free(config->drives);
	db_sources_free(config->sources, config->source_count);
	free(config);
}
