/* SPDX-License-Identifier: Apache-2.0 */
/* One key of one section: from its text to its value, or to a message with what would be right. */
#include "config/keys.h"
#include "config/load.h"
#include "config/text.h"
#include "drivebridge/driver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

unsigned db_section_line(const struct db_section *section, const char *key)
{
	unsigned line = db_outline_key_line(&section->load->outline, section->place, key);

	return line > 0 ? line : section->line;
}

bool db_section_has(const struct db_section *section, const char *key)
{
	return db_outline_key_line(&section->load->outline, section->place, key) > 0;
}

static void describe_range(const struct db_config_key *key, char *text, size_t size)
{
	const char *space = key->unit[0] ? " " : "";

	if (key->kind == DB_KEY_INTEGER && db_text_is_hex(key->preset))
		snprintf(text, size, "a whole number from 0x%X to 0x%X%s%s", (unsigned)key->min,
		         (unsigned)key->max, space, key->unit);
	else if (key->kind == DB_KEY_REAL)
		snprintf(text, size, "a number from %g to %g%s%s", key->min, key->max, space,
		         key->unit);
	else if (key->kind == DB_KEY_NUMBER || key->kind == DB_KEY_INTEGER)
		snprintf(text, size, "a whole number from %.0f to %.0f%s%s", key->min, key->max,
		         space, key->unit);
	else if (key->kind == DB_KEY_WORD)
		snprintf(text, size, "one of: %s", key->words);
	else if (key->kind == DB_KEY_PROTOCOL)
		snprintf(text, size, "the name of a family such as %s", db_drivers[0]->name);
	else if (key->kind == DB_KEY_BUS)
		snprintf(text, size, "the name of a bus section");
	else
		snprintf(text, size, "%.0f to %.0f characters", key->min, key->max);
}

/* Null when the key is not given and has to be; that is reported. */
static const char *text_of(const struct db_section *section, const struct db_config_key *key)
{
	char range[128];

	if (db_section_has(section, key->name))
		return cfg_getstr(section->values, key->name);
	if (key->preset)
		return key->preset;
	describe_range(key, range, sizeof(range));
	db_report_error(&section->load->report, section->line,
	                "%s '%s' has no key '%s', which must be given; add %s = ..., %s",
	                section->name, section->title, key->name, key->name, range);
	return NULL;
}

static void report_value(const struct db_section *section, const struct db_config_key *key,
                         const char *text, const char *wrong)
{
	char range[128];

	describe_range(key, range, sizeof(range));
	db_report_error(&section->load->report, db_section_line(section, key->name),
	                "%s = %s %s; %s", key->name, text, wrong, range);
}

static bool in_range(const struct db_config_key *key, double number)
{
	return number >= key->min && number <= key->max;
}

unsigned db_section_number(const struct db_section *section, const char *name)
{
	const struct db_config_key *key = db_config_key_find(section->name, name);
	const char *text = text_of(section, key);
	unsigned number = 0;

	if (!text || (text[0] == '\0' && !db_section_has(section, name)))
		return 0;
	if (text[0] == '\0' || text[strspn(text, "0123456789")] != '\0') {
		report_value(section, key, text, "is no whole number");
		return 0;
	}
	if (!db_text_number(text, &number) || !in_range(key, number)) {
		report_value(section, key, text, "is out of range");
		return 0;
	}
	return number;
}

double db_section_real(const struct db_section *section, const char *name)
{
	const struct db_config_key *key = db_config_key_find(section->name, name);
	const char *text = text_of(section, key);
	double number = 0;

	if (!text)
		return 0;
	if (text[0] == '\0' && !db_section_has(section, name))
		return NAN;
	if (!db_text_real(text, &number)) {
		report_value(section, key, text, "is no number");
		return 0;
	}
	if (!in_range(key, number)) {
		report_value(section, key, text, "is out of range");
		return 0;
	}
	return number;
}

double db_section_option(const struct db_section *section, const struct db_option *option)
{
	struct db_config_key key = db_config_option_key(option);
	const char *text = text_of(section, &key);
	double number = NAN;
	unsigned position = 0;

	if (!text || (text[0] == '\0' && !db_section_has(section, key.name)))
		return NAN;
	if (key.kind == DB_KEY_WORD) {
		if (db_text_word(text, key.words, &position))
			return position;
		report_value(section, &key, text, "is none of its words");
		return NAN;
	}
	if (key.kind == DB_KEY_INTEGER ? !db_text_integer(text, &number) :
	                                 !db_text_real(text, &number)) {
		report_value(section, &key, text,
		             key.kind == DB_KEY_INTEGER ? "is no whole number" : "is no number");
		return NAN;
	}
	if (!in_range(&key, number)) {
		report_value(section, &key, text, "is out of range");
		return NAN;
	}
	return number;
}

unsigned db_section_word(const struct db_section *section, const char *name)
{
	const struct db_config_key *key = db_config_key_find(section->name, name);
	const char *text = text_of(section, key);
	unsigned position = 0;

	if (!text || (text[0] == '\0' && !db_section_has(section, name)))
		return 0;
	if (!db_text_word(text, key->words, &position))
		report_value(section, key, text, "is none of its words");
	return position;
}

char *db_section_text(const struct db_section *section, const char *name)
{
	const struct db_config_key *key = db_config_key_find(section->name, name);
	const char *text = text_of(section, key);
	char *copy;

	if (!text)
		return NULL;
	if ((key->kind == DB_KEY_TEXT || key->kind == DB_KEY_CPUS) &&
	    ((double)strlen(text) < key->min || (double)strlen(text) > key->max)) {
		report_value(section, key, text, "is too short or too long");
		return NULL;
	}
	if (key->kind == DB_KEY_LISTEN && !db_text_listen(text)) {
		db_report_error(
			&section->load->report, db_section_line(section, name),
			"%s = %s is no address and port; \"0.0.0.0:502\" or \"[::]:502\", numbers only, for instance",
			name, text);
		return NULL;
	}
	copy = strdup(text);
	if (!copy)
		db_report_error(&section->load->report, 0,
		                "out of memory; free some and try again");
	return copy;
}

static void read_network(const struct db_section *section, const char *name, const char *text,
                         struct db_network *network)
{
	struct db_report *report = &section->load->report;
	unsigned line = db_section_line(section, name);
	char right[DB_NETWORK_TEXT_MAX];

	switch (db_text_network(text, network)) {
	case DB_NETWORK_OK:
		break;
	case DB_NETWORK_NO_ADDRESS:
		db_report_error(
			report, line,
			"%s: '%s' is no network; \"192.168.10.0/24\", \"192.168.10.5\" or \"fd00::/8\", for instance",
			name, text);
		break;
	case DB_NETWORK_PREFIX:
		db_report_error(
			report, line,
			"%s: '%s' has no good prefix length; 0 to 32 for IPv4, 0 to 128 for IPv6",
			name, text);
		break;
	case DB_NETWORK_HOST_BITS:
		db_network_text(network, right);
		db_report_error(
			report, line,
			"%s: '%s' has address bits beyond its prefix; \"%s\" for the whole network, or the address without a prefix for one client",
			name, text, right);
		break;
	}
}

static struct db_network *preset_networks(const struct db_section *section,
                                          const struct db_config_key *key,
                                          struct db_network *networks, size_t *count)
{
	const char *rest = key->preset;

	while (*rest && *count < 2) {
		char text[DB_NETWORK_TEXT_MAX];
		size_t length = strcspn(rest, " ");

		snprintf(text, sizeof(text), "%.*s", (int)length, rest);
		read_network(section, key->name, text, &networks[(*count)++]);
		rest += length;
		rest += *rest == ' ';
	}
	return networks;
}

struct db_network *db_section_networks(const struct db_section *section, const char *name,
                                       size_t *count)
{
	const struct db_config_key *key = db_config_key_find(section->name, name);
	bool given = db_section_has(section, name);
	size_t size = given ? cfg_size(section->values, name) : 0;
	struct db_network *networks = calloc(size + 2, sizeof(*networks));

	*count = 0;
	if (!networks) {
		db_report_error(&section->load->report, 0,
		                "out of memory; free some and try again");
		return NULL;
	}
	if (!given)
		return preset_networks(section, key, networks, count);
	for (size_t i = 0; i < size; i++)
		read_network(section, name, cfg_getnstr(section->values, name, (unsigned)i),
		             &networks[(*count)++]);
	if (size == 0) {
		/* Nobody: the unspecified address, which no client can have. An empty array would
		 * mean that nothing was configured. */
		networks[0].prefix = 128;
		*count = 1;
	}
	return networks;
}
