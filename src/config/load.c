/* SPDX-License-Identifier: Apache-2.0 */
#include "config/load.h"

#include "config/keys.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define FILE_MAX ((size_t)1 << 20)

/* The configuration and the file name its sections point to, freed as one. */
struct loaded {
	struct db_config config; /* first, so that a pointer to it is one to the whole */
	char file[];
};

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

int db_config_parse_with(const struct db_built_in *built_in, const char *text, const char *file,
                         FILE *errors, struct db_config **config)
{
	struct loaded *loaded = calloc(1, sizeof(*loaded) + strlen(file) + 1);
	char *copy = strdup(text);
	struct db_load load = { .built_in = built_in };
	bool good;

	if (!loaded || !copy) {
		fprintf(errors, "%s: out of memory; free some and try again\n", file);
		free(loaded);
		free(copy);
		return -1;
	}
	memcpy(loaded->file, file, strlen(file) + 1);
	load.file = loaded->file;
	load.config = &loaded->config;
	read_text(&load, copy);
	good = load.report.errors == 0;
	db_report_print(&load.report, file, errors);
	db_report_clear(&load.report);
	db_outline_clear(&load.outline);
	if (load.root)
		cfg_free(load.root);
	free(copy);
	if (!good) {
		db_config_free(&loaded->config);
		return -1;
	}
	*config = &loaded->config;
	return 0;
}

int db_config_parse(const char *text, const char *file, FILE *errors, struct db_config **config)
{
	return db_config_parse_with(&db_config_built_in, text, file, errors, config);
}

/* Null when the text may be used, else what is wrong with it. */
static const char *file_fault(const char *text, size_t length, bool failed)
{
	if (failed)
		return strerror(errno ? errno : EIO);
	if (length > FILE_MAX)
		return "longer than 1 MiB";
	return strlen(text) != length ? "has a zero byte in it" : NULL;
}

/* The whole file as a text to be freed, or null after a message. */
static char *read_file(const char *path, FILE *errors)
{
	FILE *file = fopen(path, "re");
	char *text = file ? malloc(FILE_MAX + 2) : NULL;
	const char *fault;

	if (text) {
		size_t length;

		errno = 0;
		length = fread(text, 1, FILE_MAX + 1, file);
		text[length] = '\0';
		fault = file_fault(text, length, ferror(file) != 0);
	} else {
		fault = strerror(errno);
	}
	if (file)
		fclose(file);
	if (fault) {
		fprintf(errors, "%s: %s; the path of a readable configuration file\n", path, fault);
		free(text);
		return NULL;
	}
	return text;
}

int db_config_load(const char *path, FILE *errors, struct db_config **config)
{
	char *text = read_file(path, errors);
	int result;

	if (!text)
		return -1;
	result = db_config_parse(text, path, errors, config);
	free(text);
	return result;
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
	}
	free(config->buses);
	free(config->drives);
	free(config);
}
