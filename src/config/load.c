/* SPDX-License-Identifier: Apache-2.0 */
#include "config/load.h"

#include "config/keys.h"
#include "config/sources.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <malloc.h>
#include <stdlib.h>
#include <string.h>

/* The reader gives messages of its own, with lines that are right. */
static void ignore_message(cfg_t *cfg, const char *format, va_list arguments)
{
	(void)cfg;
	(void)format;
	(void)arguments;
}

const struct db_built_in db_config_built_in = { db_drivers, db_transports };

/* libconfuse's table of a section's keys while it is made. */
struct table {
	const char *section;
	cfg_opt_t *options; /* null: only count */
	size_t count;
};

/* All values are read as text, so that messages about them are ours. */
static void visit_key(void *context, const struct db_config_key *key, const char *families)
{
	struct table *table = context;
	cfg_opt_t one = CFG_STR(key->name, NULL, CFGF_NODEFAULT);
	cfg_opt_t list = CFG_STR_LIST(key->name, NULL, CFGF_NODEFAULT);

	(void)families;
	if (strcmp(key->section, table->section) != 0)
		return;
	/* An option that families declare differently is the same key to libconfuse. */
	for (size_t i = 0; table->options && i < table->count; i++) {
		if (strcmp(table->options[i].name, key->name) == 0)
			return;
	}
	if (table->options)
		table->options[table->count] = key->kind == DB_KEY_NETWORKS ? list : one;
	table->count++;
}

/* To be freed; null when out of memory. */
static cfg_opt_t *section_table(const struct db_driver *const *drivers, const char *section)
{
	struct table table = { .section = section };
	const cfg_opt_t end = CFG_END();

	db_config_each_key(drivers, visit_key, &table);
	table.options = calloc(table.count + 1, sizeof(*table.options));
	if (!table.options)
		return NULL;
	table.count = 0;
	db_config_each_key(drivers, visit_key, &table);
	table.options[table.count] = end;
	return table.options;
}

static cfg_t *new_parser(const struct db_driver *const *drivers)
{
	cfg_opt_t *modbus = section_table(drivers, "modbus");
	cfg_opt_t *bus = section_table(drivers, "bus");
	cfg_opt_t *drive = section_table(drivers, "drive");
	cfg_t *root = NULL;

	if (modbus && bus && drive) {
		cfg_opt_t options[] = {
			CFG_SEC("modbus", modbus, CFGF_NONE),
			CFG_SEC("bus", bus, CFGF_MULTI | CFGF_TITLE),
			CFG_SEC("drive", drive, CFGF_MULTI | CFGF_TITLE),
			CFG_END(),
		};
		root = cfg_init(options, CFGF_NONE);
	}
	free(modbus);
	free(bus);
	free(drive);
	if (root)
		cfg_set_error_function(root, ignore_message);
	return root;
}

/* Everything between the text and the configuration; errors are in the report. */
static void read_text(struct db_load *load, char *text)
{
	if (!db_outline_read(load->built_in->drivers, text, &load->outline, &load->report))
		return;
	load->root = new_parser(load->built_in->drivers);
	if (!load->root) {
		db_report_error(&load->report, 0, "out of memory; free some and try again");
		return;
	}
	/* After the outline's checks this fails for lack of memory only. */
	if (cfg_parse_buf(load->root, text) != CFG_SUCCESS || !db_load_sections(load))
		db_report_error(&load->report, 0, "out of memory; free some and try again");
	else
		db_load_check(load);
}

/* From here on sections name their file, and the line there. */
static void place_sections(struct db_config *config, const struct db_report *report)
{
	for (size_t i = 0; i < config->bus_count; i++) {
		struct db_bus_config *bus = &config->buses[i];
		const struct db_config_source *source = db_report_source(report, bus->source_line);

		bus->source_file = source->path;
		bus->source_line -= source->lines_before;
	}
	for (size_t i = 0; i < config->drive_count; i++) {
		struct db_drive_config *drive = &config->drives[i];
		const struct db_config_source *source = db_report_source(report,
		                                                         drive->source_line);

		drive->source_file = source->path;
		drive->source_line -= source->lines_before;
	}
}

/* Takes the sources over. */
static int parse(const struct db_built_in *built_in, struct db_config_source *sources, size_t count,
                 FILE *errors, struct db_config **config)
{
	struct db_config *made = calloc(1, sizeof(*made));
	char *text = db_sources_join(sources, count);
	struct db_load load = {
		.built_in = built_in,
		.report = { .sources = sources, .source_count = count },
		.config = made,
	};
	bool good;

	if (!made || !text) {
		fprintf(errors, "%s: out of memory; free some and try again\n", sources[0].path);
		db_sources_free(sources, count);
		free(made);
		free(text);
		return -1;
	}
	made->sources = sources;
	made->source_count = count;
	read_text(&load, text);
	good = load.report.errors == 0;
	db_report_print(&load.report, sources[0].path, errors);
	if (good)
		place_sections(made, &load.report);
	for (size_t i = 0; i < count; i++) {
		free(sources[i].text);
		sources[i].text = NULL;
	}
	db_report_clear(&load.report);
	db_outline_clear(&load.outline);
	if (load.root)
		cfg_free(load.root);
	free(text);
	if (!good) {
		db_config_free(made);
		return -1;
	}
	*config = made;
	return 0;
}

int db_config_parse_with(const struct db_built_in *built_in, const char *text, const char *file,
                         FILE *errors, struct db_config **config)
{
	struct db_config_source *source = db_sources_of_text(file, text);

	if (!source) {
		fprintf(errors, "%s: out of memory; free some and try again\n", file);
		return -1;
	}
	return parse(built_in, source, 1, errors, config);
}

int db_config_parse(const char *text, const char *file, FILE *errors, struct db_config **config)
{
	return db_config_parse_with(&db_config_built_in, text, file, errors, config);
}

int db_config_load(const char *path, FILE *errors, struct db_config **config)
{
	struct db_config_source *sources;
	size_t count;

	if (db_sources_read(path, errors, &sources, &count) != 0) {
		db_sources_free(sources, count);
		return -1;
	}
	if (parse(&db_config_built_in, sources, count, errors, config) != 0)
		return -1;
	/* The parser had kilobytes for every section, below what stays: once memory is locked they would
	 * stay, too. */
	malloc_trim(0);
	return 0;
}

void db_config_free(struct db_config *config)
{
	if (!config)
		return;
	free(config->modbus.listen);
	free(config->modbus.allow_read);
	free(config->modbus.allow_write);
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
