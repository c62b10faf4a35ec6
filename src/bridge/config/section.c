/* SPDX-License-Identifier: Apache-2.0 */
#include "config/section.h"

#include "config/keys.h"
#include "config/names.h"
#include "config/text.h"
#include "drivebridge/driver.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#define OUT_OF_MEMORY "out of memory; free some and try again"

struct db_section db_section_open(struct db_load *load, size_t index)
{
	return (struct db_section){
		.load = load,
		.name = load->reader.sections[index].name,
		.title = load->reader.sections[index].title,
		.index = index,
		.line = load->reader.sections[index].line,
	};
}

struct db_section db_section_open_only(struct db_load *load, const char *name)
{
	size_t index = db_reader_find_section(&load->reader, name, "");

	if (index != DB_READER_NO_SECTION)
		return db_section_open(load, index);
	return (struct db_section){ .load = load, .name = name, .title = "", .index = index };
}

static struct db_reader_key *find_key(const struct db_section *section, const char *name)
{
	return db_reader_find_key(&section->load->reader, section->index, name);
}

bool db_section_has(const struct db_section *section, const char *name)
{
	return find_key(section, name) != NULL;
}

bool db_section_misread(const struct db_section *section, const char *name)
{
	const struct db_reader_key *key = find_key(section, name);

	return key && key->misread;
}

unsigned db_section_line(const struct db_section *section, const char *name)
{
	const struct db_reader_key *key = find_key(section, name);

	return key ? key->line : section->line;
}

unsigned db_section_find_line(const struct db_load *load, const char *section, const char *title,
                              unsigned head, const char *name)
{
	size_t index = db_reader_find_section(&load->reader, section, title);
	const struct db_reader_key *key = db_reader_find_key(&load->reader, index, name);

	return key ? key->line : head;
}

/* --- one value -------------------------------------------------------------------------------- */

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
	else if (key->words[0] != '\0')
		snprintf(text, size, "one of: %s", key->words);
	else if (key->kind == DB_KEY_PROTOCOL)
		snprintf(text, size, "the name of a family such as %s", db_drivers[0]->name);
	else if (key->kind == DB_KEY_BUS)
		snprintf(text, size, "the name of a bus section");
	else if (key->kind == DB_KEY_LISTEN)
		snprintf(text, size, "an address and a port such as \"0.0.0.0:503\"");
	else
		snprintf(text, size, "%.0f to %.0f characters", key->min, key->max);
}

/* The text in the file, else the preset. Null when it is mandatory, which is reported. */
static const char *text_of(const struct db_section *section, const struct db_config_key *key)
{
	const struct db_reader_key *given = find_key(section, key->name);
	char range[128];

	if (given)
		return given->values;
	if (key->preset)
		return key->preset;
	describe_range(key, range, sizeof(range));
	db_messages_add_error(&section->load->messages, section->line,
	                      "%s '%s' has no key '%s', which must be given; add %s = ..., %s",
	                      section->name, section->title, key->name, key->name, range);
	return NULL;
}

/* False when it was marked already: a key of a profile is read for each section that has it. */
static bool mark_misread(const struct db_section *section, const char *name)
{
	struct db_reader_key *key = find_key(section, name);
	bool first = !key || !key->misread;

	if (key)
		key->misread = true;
	return first;
}

static void refuse_value(const struct db_section *section, const struct db_config_key *key,
                         const char *text, const char *wrong)
{
	char range[128];

	if (!mark_misread(section, key->name))
		return;
	describe_range(key, range, sizeof(range));
	db_messages_add_error(&section->load->messages, db_section_line(section, key->name),
	                      "%s = %s %s; %s", key->name, text, wrong, range);
}

/* The length of the number in a text such as 40ms or 640mm; 0 for any other text, a hexadecimal
 * number among them. */
static size_t number_before_unit(const char *text)
{
	size_t digits = strspn(text, "0123456789.");
	const char *unit = text + digits;

	if (strncasecmp(text, "0x", 2) == 0)
		return 0;
	while (isalpha((unsigned char)*unit) || *unit == '/' || (unsigned char)*unit >= 0x80)
		unit++;
	return *unit == '\0' && text[digits] != '\0' ? digits : 0;
}

/* False when it is no such number, which is reported. */
static bool parse_number(const struct db_section *section, const struct db_config_key *key,
                         const char *text, double *number)
{
	bool whole = key->kind != DB_KEY_REAL;
	size_t length = number_before_unit(text);
	char unit[64];
	unsigned small;
	bool good;

	if (key->kind == DB_KEY_NUMBER) {
		/* More digits than fit are outside every range. */
		good = text[0] != '\0' && text[strspn(text, "0123456789")] == '\0';
		*number = db_text_number(text, &small) ? (double)small : HUGE_VAL;
	} else {
		good = whole ? db_text_integer(text, number) : db_text_real(text, number);
	}
	if (good && *number >= key->min && *number <= key->max)
		return true;
	snprintf(unit, sizeof(unit), "has a unit behind its number; write %.*s", (int)length, text);
	refuse_value(section, key, text,
	             good       ? "is out of range" :
	             length > 0 ? unit :
	             whole      ? "is no whole number" :
	                          "is no number");
	return false;
}

/* False when it is none of the key's words, which is reported. */
static bool parse_word(const struct db_section *section, const struct db_config_key *key,
                       const char *text, unsigned *position)
{
	if (db_text_word(text, key->words, position))
		return true;
	refuse_value(section, key, text, "is none of its words");
	return false;
}

const char *db_section_text(const struct db_section *section, const char *name)
{
	return text_of(section, db_keys_find(section->name, name));
}

bool db_section_word(const struct db_section *section, const char *name, unsigned *position)
{
	const struct db_config_key *key = db_keys_find(section->name, name);

	return parse_word(section, key, text_of(section, key), position);
}

/* A copy, to be freed; null when it is no such text, which is reported. */
static char *parse_text(const struct db_section *section, const struct db_config_key *key,
                        const char *text)
{
	double length = (double)strlen(text);
	char *copy;

	if (key->kind == DB_KEY_TEXT && (length < key->min || length > key->max)) {
		refuse_value(section, key, text, "is too short or too long");
		return NULL;
	}
	if (key->kind == DB_KEY_LISTEN && !db_text_listen(text)) {
		(void)mark_misread(section, key->name);
		db_messages_add_error(&section->load->messages, db_section_line(section, key->name),
		                      "%s = %s is no address and port; \"0.0.0.0:502\" or "
		                      "\"[::]:502\", numbers only, for instance",
		                      key->name, text);
		return NULL;
	}
	copy = strdup(text);
	if (!copy)
		db_messages_add_error(&section->load->messages, 0, OUT_OF_MEMORY);
	return copy;
}

/* The file may be checked on another machine than the intended one: processors missing here are a
 * warning. */
static uint64_t parse_cpus(const struct db_section *section, const struct db_config_key *key,
                           const char *text)
{
	struct db_messages *messages = &section->load->messages;
	unsigned line = db_section_line(section, key->name);
	long here = sysconf(_SC_NPROCESSORS_CONF);
	double length = (double)strlen(text);
	uint64_t cpus = 0;

	if (length < key->min || length > key->max)
		refuse_value(section, key, text, "is too short or too long");
	else if (!db_text_cpus(text, &cpus))
		db_messages_add_error(
			messages, line,
			"cpus = %s is no list of processors; numbers from 0 to 63 and ranges of "
			"them with commas between, such as 3 or \"2-3,5\", or any",
			text);
	else if (here > 0 && here < 64 && cpus >> here != 0)
		db_messages_add_warning(
			messages, line,
			"cpus = %s: this machine has only the processors 0 to %ld; the bus runs on "
			"those of the list that there are, or on any",
			text, here - 1);
	return cpus;
}

/* --- networks --------------------------------------------------------------------------------- */

static void parse_network(const struct db_section *section, const char *name, const char *text,
                          struct db_network *network)
{
	struct db_messages *messages = &section->load->messages;
	unsigned line = db_section_line(section, name);
	char right[DB_NETWORK_TEXT_MAX];

	switch (db_text_network(text, network)) {
	case DB_NETWORK_OK:
		break;
	case DB_NETWORK_NO_ADDRESS:
		db_messages_add_error(messages, line,
		                      "%s: '%s' is no network; \"192.168.10.0/24\", "
		                      "\"192.168.10.5\" or \"fd00::/8\", for instance",
		                      name, text);
		break;
	case DB_NETWORK_PREFIX:
		db_messages_add_error(
			messages, line,
			"%s: '%s' has no good prefix length; 0 to 32 for IPv4, 0 to 128 for IPv6",
			name, text);
		break;
	case DB_NETWORK_HOST_BITS:
		db_text_of_network(network, right);
		db_messages_add_error(
			messages, line,
			"%s: '%s' has address bits beyond its prefix; \"%s\" for the whole "
			"network, or the address without a prefix for one client",
			name, text, right);
		break;
	}
}

/* A list to be freed, followed by its count; both stay 0 when out of memory, which is reported. */
static void read_networks(const struct db_section *section, const struct db_config_key *key,
                          void *member)
{
	const struct db_reader_key *given = find_key(section, key->name);
	const char *text = given ? given->values : key->preset;
	size_t size = given ? given->count : 2; /* a preset has at most this number */
	struct db_network *networks;
	size_t count = 0;

	/* Its default is not one list, and is filled in by the reader of the section. */
	if (!given && *text == '\0')
		return;
	networks = calloc(size + 1, sizeof(*networks));
	if (!networks) {
		db_messages_add_error(&section->load->messages, 0, OUT_OF_MEMORY);
		return;
	}
	while (given && count < size) {
		parse_network(section, key->name, text, &networks[count++]);
		text += strlen(text) + 1;
	}
	while (!given && *text && count < size) {
		char one[DB_NETWORK_TEXT_MAX];
		size_t length = strcspn(text, " ");

		snprintf(one, sizeof(one), "%.*s", (int)length, text);
		parse_network(section, key->name, one, &networks[count++]);
		text += length + (text[length] == ' ');
	}
	/* No client: the unspecified address, which no client can have. An empty array would mean
	 * that nothing was configured. */
	if (given && size == 0)
		networks[count++].prefix = 128;
	memcpy(member, &networks, sizeof(networks));
	memcpy((char *)member + sizeof(networks), &count, sizeof(count));
}

/* --- drives ----------------------------------------------------------------------------------- */

/* Whether there are such drives is checked when all are read. */
static void read_drives(const struct db_section *section, const struct db_config_key *key,
                        void *member)
{
	const struct db_reader_key *given = find_key(section, key->name);
	struct db_drive_set set = { .all = false };
	unsigned position;

	if (given && given->list) {
		/* With the empty name that ends it. */
		set.names = calloc(1, given->size + 1);
		if (set.names && given->size > 0)
			memcpy(set.names, given->values, given->size);
		if (!set.names)
			db_messages_add_error(&section->load->messages, 0, OUT_OF_MEMORY);
	} else if (parse_word(section, key, given ? given->values : key->preset, &position)) {
		set.all = position == 0;
	}
	memcpy(member, &set, sizeof(set));
	/* Neither cppcheck nor gcc's analyzer sees that the member has it now. */
	// cppcheck-suppress memleak
}

/* --- units ------------------------------------------------------------------------------------ */

/* The preset is the word; a list has ids and ranges. */
static void read_units(const struct db_section *section, const struct db_config_key *key,
                       void *member)
{
	const struct db_reader_key *given = find_key(section, key->name);
	const char *text = given ? given->values : key->preset;
	uint8_t units[DB_UNITS_SIZE] = { 0 };
	unsigned position;

	if (!given || !given->list) {
		if (parse_word(section, key, text, &position))
			(void)db_text_units(DB_UNITS_ALL, units);
	}
	for (size_t i = 0; given && given->list && i < given->count; i++) {
		if (!db_text_units(text, units))
			db_messages_add_error(
				&section->load->messages, db_section_line(section, key->name),
				"%s: '%s' is no unit id; a number from 1 to 247, or a "
				"range such as \"10-19\"",
				key->name, text);
		text += strlen(text) + 1;
	}
	memcpy(member, units, sizeof(units));
}

/* --- all of them ------------------------------------------------------------------------------ */

/* Reads its text into the member of the section's struct, which is zero. */
static void read_value(const struct db_section *section, const struct db_config_key *key,
                       const char *text, void *member)
{
	unsigned number = 0, position = 0;
	double real = 0;
	uint64_t cpus;
	char *copy;

	switch (key->kind) {
	case DB_KEY_NUMBER:
	case DB_KEY_INTEGER:
		if (parse_number(section, key, text, &real))
			number = (unsigned)real;
		memcpy(member, &number, sizeof(number));
		break;
	case DB_KEY_REAL:
		if (!parse_number(section, key, text, &real))
			real = 0;
		memcpy(member, &real, sizeof(real));
		break;
	case DB_KEY_WORD:
		(void)parse_word(section, key, text, &position);
		db_keys_put_word(key, member, position);
		break;
	case DB_KEY_TEXT:
	case DB_KEY_LISTEN:
		copy = parse_text(section, key, text);
		memcpy(member, &copy, sizeof(copy));
		break;
	case DB_KEY_CPUS:
		cpus = parse_cpus(section, key, text);
		memcpy(member, &cpus, sizeof(cpus));
		break;
	case DB_KEY_NETWORKS:
	case DB_KEY_DRIVES:
	case DB_KEY_UNITS:
	case DB_KEY_PROTOCOL:
	case DB_KEY_TRANSPORT:
	case DB_KEY_BUS:
	case DB_KEY_PROFILE:
		break;
	}
}

void db_section_read(const struct db_section *section, void *values)
{
	static const double none = NAN;
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);

	for (size_t i = 0; i < count; i++) {
		const struct db_config_key *key = &keys[i];
		void *member = (char *)values + key->offset;
		/* Otherwise there was or will be a message about it. */
		bool fits = !section->driver || db_keys_fit(key, section->driver);
		const char *text;

		/* What names something else is stored by the caller. */
		if (strcmp(key->section, section->name) != 0 || key->kind == DB_KEY_PROTOCOL ||
		    key->kind == DB_KEY_TRANSPORT || key->kind == DB_KEY_BUS ||
		    key->kind == DB_KEY_PROFILE)
			continue;
		if (key->kind == DB_KEY_NETWORKS) {
			read_networks(section, key, member);
			continue;
		}
		if (key->kind == DB_KEY_DRIVES) {
			read_drives(section, key, member);
			continue;
		}
		if (key->kind == DB_KEY_UNITS) {
			read_units(section, key, member);
			continue;
		}
		text = fits ? text_of(section, key) : key->preset;
		if (text && (text[0] != '\0' || (fits && db_section_has(section, key->name))))
			read_value(section, key, text, member);
		else if (key->kind == DB_KEY_REAL)
			memcpy(member, &none, sizeof(none));
	}
}

/* --- families --------------------------------------------------------------------------------- */

/* A key of the table that is not for this family, and what to do with it. */
static void refuse_key(const struct db_section *section, const struct db_reader_key *key,
                       enum db_config_scope scope)
{
	struct db_messages *messages = &section->load->messages;
	const char *family = section->driver->name;
	const char *advice = "remove it";

	if (strcmp(key->name, "interface") == 0)
		advice = "remove it and name the port with device";
	else if (strcmp(key->name, "bitrate") == 0)
		advice = "remove it and set the speed with baud";
	if (scope == DB_KEY_FOR_AXES)
		db_messages_add_error(
			messages, key->line,
			"%s is for multi-axis families, but %s has one axis behind an address; %s",
			key->name, family, advice);
	else if (scope == DB_KEY_FOR_VSMD)
		db_messages_add_error(messages, key->line,
		                      "%s is for VSMD families, whose vendor has a register map of "
		                      "its own, but drive '%s' is of family %s; %s",
		                      key->name, section->title, family, advice);
	else
		db_messages_add_error(messages, key->line,
		                      "%s is for %s families, but %s runs on %s; %s", key->name,
		                      scope == DB_KEY_FOR_CAN ? "CAN" : "serial", family,
		                      scope == DB_KEY_FOR_CAN ? "a serial line" : "CAN", advice);
}

static void check_family(const struct db_section *section, const struct db_reader_key *key)
{
	const struct db_config_key *common = db_keys_find(section->name, key->name);
	char families[DB_FAMILIES_TEXT_MAX];

	if (common && !db_keys_fit(common, section->driver))
		refuse_key(section, key, common->scope);
	if (common || db_keys_find_option(section->driver, section->name, key->name))
		return;
	db_names_list_families(section->load->built_in->drivers, section->name, key->name,
	                       families);
	db_messages_add_error(&section->load->messages, key->line,
	                      "%s is a key of %s, but %s '%s' is of family %s; remove it",
	                      key->name, families, section->name, section->title,
	                      section->driver->name);
}

/* Number, or position of the word; NAN when it is invalid, or neither given nor preset. */
static double read_option(const struct db_section *section, const struct db_option *option)
{
	struct db_config_key key = db_keys_of_option(option);
	const char *text = text_of(section, &key);
	unsigned position = 0;
	double number;

	if (!text || (text[0] == '\0' && !db_section_has(section, key.name)))
		return NAN;
	if (key.kind == DB_KEY_WORD)
		return parse_word(section, &key, text, &position) ? (double)position : (double)NAN;
	return parse_number(section, &key, text, &number) ? number : (double)NAN;
}

void *db_section_read_options(const struct db_section *section)
{
	const struct db_reader *reader = &section->load->reader;
	const struct db_driver *driver = section->driver;
	size_t size = !driver                           ? 0 :
	              strcmp(section->name, "bus") == 0 ? driver->bus_options_size :
	                                                  driver->drive_options_size;
	/* More than needed: calloc() of nothing may give null. */
	void *options = calloc(1, size + 1);

	if (!driver || !options)
		return options;
	for (size_t i = 0; i < reader->key_count; i++) {
		if (reader->keys[i].section == section->index && !reader->keys[i].refused)
			check_family(section, &reader->keys[i]);
	}
	for (size_t i = 0; i < driver->option_count; i++) {
		if (strcmp(driver->options[i].section, section->name) == 0)
			db_option_set(&driver->options[i], options,
			              read_option(section, &driver->options[i]));
	}
	return options;
}
