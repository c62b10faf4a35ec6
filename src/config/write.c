/* SPDX-License-Identifier: Apache-2.0 */
/* A configuration as a file with every key, from the table of keys. */
#include "config/keys.h"
#include "config/text.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A section that is written, and the family its keys are for; null for modbus. */
struct written {
	const struct db_config *config;
	const void *section;
	const struct db_driver *driver;
	FILE *out;
};

static void put_key(const struct written *written, const char *name)
{
	fprintf(written->out, "\t%s = ", name);
}

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

/* In quotes, because of the sign of an exponent. */
static void put_real(FILE *out, double value)
{
	char text[40];

	snprintf(text, sizeof(text), "%.15g", value);
	if (fabs(strtod(text, NULL) - value) > 0)
		snprintf(text, sizeof(text), "%.17g", value);
	put_quoted(out, text);
}

static void put_word(FILE *out, const char *words, unsigned position)
{
	while (position-- > 0) {
		words += strcspn(words, " ");
		words += *words == ' ';
	}
	fprintf(out, "%.*s", (int)strcspn(words, " "), words);
}

static void put_networks(const struct written *written, const struct db_config_key *key,
                         const void *member)
{
	static const struct db_network nobody = { .prefix = 128 };
	const struct db_network *networks;
	const char *before = "";
	size_t count;

	memcpy(&networks, member, sizeof(networks));
	memcpy(&count, (const char *)member + sizeof(networks), sizeof(count));
	put_key(written, key->name);
	fputc('{', written->out);
	for (size_t i = 0; i < count; i++) {
		char text[DB_NETWORK_TEXT_MAX];

		if (memcmp(&networks[i], &nobody, sizeof(nobody)) == 0)
			continue;
		db_network_text(&networks[i], text);
		fprintf(written->out, "%s\"%s\"", before, text);
		before = ", ";
	}
	fputs("}\n", written->out);
}

/* A word's position, however its member is kept. */
static unsigned position_of(const struct db_config_key *key, const void *member)
{
	unsigned position = 0;

	if (key->size == sizeof(bool))
		return *(const bool *)member;
	memcpy(&position, member, sizeof(position));
	/* Levels are syslog's numbers. */
	return strcmp(key->name, "log") == 0 ? position - DB_LOG_ERROR : position;
}

static void write_number(const struct written *written, const struct db_config_key *key,
                         const void *member)
{
	unsigned number;

	memcpy(&number, member, sizeof(number));
	/* What does not apply, such as the baud rate of a CAN interface. */
	if (number == 0 && key->min > 0 && key->preset && key->preset[0] == '\0')
		return;
	put_key(written, key->name);
	fprintf(written->out, "%u\n", number);
}

static void write_text(const struct written *written, const struct db_config_key *key,
                       const void *member)
{
	const char *text;

	memcpy(&text, member, sizeof(text));
	if (!text)
		return;
	put_key(written, key->name);
	put_quoted(written->out, text);
	fputc('\n', written->out);
}

static void write_real(const struct written *written, const struct db_config_key *key,
                       const void *member)
{
	double value;

	memcpy(&value, member, sizeof(value));
	if (isnan(value))
		return;
	put_key(written, key->name);
	put_real(written->out, value);
	fputc('\n', written->out);
}

static void write_word(const struct written *written, const struct db_config_key *key,
                       const void *member)
{
	const struct db_transport *transport;

	put_key(written, key->name);
	if (strcmp(key->name, "transport") == 0) {
		memcpy(&transport, member, sizeof(transport));
		fputs(transport->name, written->out);
	} else {
		put_word(written->out, key->words, position_of(key, member));
	}
	fputc('\n', written->out);
}

static void write_cpus(const struct written *written, const struct db_config_key *key,
                       const void *member)
{
	char text[DB_CPUS_TEXT_MAX];
	uint64_t cpus;

	memcpy(&cpus, member, sizeof(cpus));
	db_cpus_text(cpus, text);
	put_key(written, key->name);
	fprintf(written->out, "\"%s\"\n", cpus != 0 ? text : "any");
}

static void write_bus_name(const struct written *written, const struct db_config_key *key,
                           const void *member)
{
	size_t bus;

	memcpy(&bus, member, sizeof(bus));
	put_key(written, key->name);
	fprintf(written->out, "%s\n", written->config->buses[bus].name);
}

static void write_value(const struct written *written, const struct db_config_key *key)
{
	const void *member = (const char *)written->section + key->offset;

	switch (key->kind) {
	case DB_KEY_TEXT:
	case DB_KEY_LISTEN:
		write_text(written, key, member);
		break;
	case DB_KEY_REAL:
		write_real(written, key, member);
		break;
	case DB_KEY_WORD:
		write_word(written, key, member);
		break;
	case DB_KEY_NETWORKS:
		put_networks(written, key, member);
		break;
	case DB_KEY_CPUS:
		write_cpus(written, key, member);
		break;
	case DB_KEY_BUS:
		write_bus_name(written, key, member);
		break;
	case DB_KEY_PROTOCOL:
		put_key(written, key->name);
		/* Only buses have this key, with their drivers; analyzers do not know it. */
		fprintf(written->out, "%s\n", written->driver ? written->driver->name : "");
		break;
	default:
		write_number(written, key, member);
		break;
	}
}

static void write_option(const struct written *written, const struct db_option *option,
                         double value)
{
	if (isnan(value))
		return;
	put_key(written, option->name);
	if (option->words[0] != '\0')
		put_word(written->out, option->words, (unsigned)value);
	else if (option->whole && db_text_is_hex(option->preset))
		fprintf(written->out, "0x%X", (unsigned)value);
	else if (option->whole)
		fprintf(written->out, "%.0f", value);
	else
		put_real(written->out, value);
	fputc('\n', written->out);
}

/* Its keys in the table's order, then the family's own. */
static void write_section(const struct written *written, const char *name, const char *title,
                          const double *options, const char *without)
{
	size_t count;
	const struct db_config_key *keys = db_config_keys(&count);

	fprintf(written->out, "%s%s%s {\n", name, title[0] ? " " : "", title);
	for (size_t i = 0; i < count; i++) {
		if (strcmp(keys[i].section, name) != 0 || strcmp(keys[i].name, without) == 0 ||
		    (written->driver && !db_config_key_fits(&keys[i], written->driver)))
			continue;
		write_value(written, &keys[i]);
	}
	for (size_t i = 0; written->driver && i < written->driver->option_count; i++) {
		if (strcmp(written->driver->options[i].section, name) == 0)
			write_option(written, &written->driver->options[i], options[i]);
	}
	fputs("}\n", written->out);
}

void db_config_write(const struct db_config *config, FILE *out)
{
	struct written written = { .config = config, .section = &config->modbus, .out = out };

	write_section(&written, "modbus", "", NULL, "");
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
		/* Without this key the drive's own knowledge counts. */
		write_section(&written, "drive", drive->name, drive->options,
		              drive->counts_given ? "" : "counts-per-unit");
	}
	fputs("end\n", out);
}
