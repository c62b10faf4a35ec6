/* SPDX-License-Identifier: Apache-2.0 */
/* A configuration as a file with every key, from the table of keys. */
#include "config/keys.h"
#include "config/text.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A section that is written, and the family its keys are for; null for modbus and control. */
struct written {
	const struct db_config *config;
	const void *section;
	const struct db_driver *driver;
	FILE *out;
};

static void put_quoted(FILE *out, const char *text)
{
	fputc('"', out);
	for (; *text; text++) {
		if (*text == '"' || *text == '\\')
			fputc('\\', out);
		fputc(*text, out);
	}
	fputc('"', out);
}

/* In quotes where it has an exponent: the sign of that is no part of a word. */
static void put_real(FILE *out, double value)
{
	char text[40];

	snprintf(text, sizeof(text), "%.15g", value);
	if (fabs(strtod(text, NULL) - value) > 0)
		snprintf(text, sizeof(text), "%.17g", value);
	if (text[strspn(text, "0123456789.-")] == '\0')
		fputs(text, out);
	else
		put_quoted(out, text);
}

static void put_networks(FILE *out, const void *member)
{
	static const struct db_network nobody = { .prefix = 128 };
	const struct db_network *networks;
	const char *before = "";
	size_t count;

	memcpy(&networks, member, sizeof(networks));
	memcpy(&count, (const char *)member + sizeof(networks), sizeof(count));
	fputc('{', out);
	for (size_t i = 0; i < count; i++) {
		char text[DB_NETWORK_TEXT_MAX];

		if (memcmp(&networks[i], &nobody, sizeof(nobody)) == 0)
			continue;
		db_text_of_network(&networks[i], text);
		fprintf(out, "%s\"%s\"", before, text);
		before = ", ";
	}
	fputc('}', out);
}

static void put_drives(FILE *out, const struct db_drive_set *set)
{
	const char *before = "";

	if (set->all || !set->names) {
		fputs(set->all ? "all" : "none", out);
		return;
	}
	fputc('{', out);
	for (const char *name = set->names; *name; name += strlen(name) + 1) {
		fprintf(out, "%s\"%s\"", before, name);
		before = ", ";
	}
	fputc('}', out);
}

/* True if there is nothing to write: a value that was not given, or does not apply, such as the
 * baud rate of a CAN interface. */
static bool is_unset(const struct db_config_key *key, const void *member)
{
	const char *text;
	unsigned number;
	double real;

	switch (key->kind) {
	case DB_KEY_TEXT:
	case DB_KEY_LISTEN:
		memcpy(&text, member, sizeof(text));
		return !text;
	case DB_KEY_REAL:
		memcpy(&real, member, sizeof(real));
		return isnan(real);
	case DB_KEY_NUMBER:
		memcpy(&number, member, sizeof(number));
		return number == 0 && key->min > 0 && key->preset && key->preset[0] == '\0';
	/* Its contents are written key by key. */
	case DB_KEY_PROFILE:
		return true;
	default:
		return false;
	}
}

static void write_value(const struct written *written, const struct db_config_key *key)
{
	const void *member = (const char *)written->section + key->offset;
	const struct db_transport *transport;
	FILE *out = written->out;
	char cpus_text[DB_CPUS_TEXT_MAX];
	char units_text[DB_UNITS_TEXT_MAX];
	const char *text;
	unsigned number;
	uint64_t cpus;
	double real;
	size_t bus;

	if (is_unset(key, member))
		return;
	fprintf(out, "\t%s = ", key->name);
	switch (key->kind) {
	case DB_KEY_NUMBER:
	case DB_KEY_INTEGER:
		memcpy(&number, member, sizeof(number));
		fprintf(out, "%u", number);
		break;
	case DB_KEY_REAL:
		memcpy(&real, member, sizeof(real));
		put_real(out, real);
		break;
	case DB_KEY_WORD:
		db_text_put_word(out, key->words, db_keys_get_word(key, member));
		break;
	case DB_KEY_TEXT:
	case DB_KEY_LISTEN:
		memcpy(&text, member, sizeof(text));
		put_quoted(out, text);
		break;
	case DB_KEY_CPUS:
		memcpy(&cpus, member, sizeof(cpus));
		db_text_of_cpus(cpus, cpus_text);
		put_quoted(out, cpus != 0 ? cpus_text : "any");
		break;
	case DB_KEY_NETWORKS:
		put_networks(out, member);
		break;
	case DB_KEY_DRIVES:
		put_drives(out, member);
		break;
	case DB_KEY_UNITS:
		db_text_of_units(member, "\"", units_text);
		fprintf(out, "{%s}", units_text);
		break;
	case DB_KEY_PROTOCOL:
		/* Only buses have this key, with their drivers; analyzers do not know it. */
		fputs(written->driver ? written->driver->name : "", out);
		break;
	case DB_KEY_TRANSPORT:
		memcpy(&transport, member, sizeof(transport));
		fputs(transport->name, out);
		break;
	case DB_KEY_BUS:
		memcpy(&bus, member, sizeof(bus));
		fputs(written->config->buses[bus].name, out);
		break;
	case DB_KEY_PROFILE:
		break;
	}
	fputc('\n', out);
}

/* Its keys in the table's order, then the family's own. */
static void write_section(const struct written *written, const char *name, const char *title,
                          const void *options, const char *without)
{
	FILE *out = written->out;
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);

	fprintf(out, "%s%s%s {\n", name, title[0] ? " " : "", title);
	for (size_t i = 0; i < count; i++) {
		if (strcmp(keys[i].section, name) != 0 || strcmp(keys[i].name, without) == 0 ||
		    (written->driver && !db_keys_fit(&keys[i], written->driver)))
			continue;
		write_value(written, &keys[i]);
	}
	for (size_t i = 0; written->driver && i < written->driver->option_count; i++) {
		const struct db_option *option = &written->driver->options[i];
		double value;

		if (strcmp(option->section, name) != 0)
			continue;
		value = db_option_value(option, options);
		if (isnan(value))
			continue;
		fprintf(out, "\t%s = ", option->name);
		if (option->words[0] != '\0')
			db_text_put_word(out, option->words, (unsigned)value);
		else if (option->whole && db_text_is_hex(option->preset))
			fprintf(out, "0x%X", (unsigned)value);
		else if (option->whole)
			fprintf(out, "%.0f", value);
		else
			put_real(out, value);
		fputc('\n', out);
	}
	fputs("}\n", out);
}

void db_config_write(const struct db_config *config, FILE *out)
{
	struct written written = { .config = config, .section = &config->modbus, .out = out };

	write_section(&written, "modbus", "", NULL, "");
	written.section = &config->control;
	write_section(&written, "control", "", NULL, "");
	for (size_t i = 0; i < config->modbus.endpoint_count; i++) {
		written.section = &config->modbus.endpoints[i];
		write_section(&written, "endpoint", config->modbus.endpoints[i].name, NULL, "");
	}
	for (size_t i = 0; i < config->modbus.role_count; i++) {
		written.section = &config->modbus.roles[i];
		write_section(&written, "role", config->modbus.roles[i].name, NULL, "");
	}
	for (size_t i = 0; i < config->modbus.line_count; i++) {
		written.section = &config->modbus.lines[i];
		write_section(&written, "modbus-rtu", config->modbus.lines[i].name, NULL, "");
	}
	for (size_t i = 0; i < config->bus_count; i++) {
		const struct db_bus_config *bus = &config->buses[i];

		written.section = bus;
		written.driver = bus->driver;
		write_section(&written, "bus", bus->name, bus->options, "");
	}
	for (size_t i = 0; i < config->drive_count; i++) {
		const struct db_drive_config *drive = &config->drives[i];

		written.section = drive;
		written.driver = config->buses[drive->bus].driver;
		/* Without this key the value reported by the drive is used. */
		write_section(&written, "drive", drive->name, drive->options,
		              drive->counts_given ? "" : "counts-per-unit");
	}
	fputs("end\n", out);
}
