/* SPDX-License-Identifier: Apache-2.0 */
#include "params/file.h"
#include "reader/reader.h"
#include "words/nearest.h"
#include "words/value.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FORMAT "1"

/* --- writing ---------------------------------------------------------------------------------- */

void db_params_write_number(const json_t *value, char *text, size_t size)
{
	double real = json_number_value(value);
	char *plus;

	if (json_is_integer(value)) {
		snprintf(text, size, "%lld", (long long)json_integer_value(value));
		return;
	}
	if (fabs(real) < 1e15 && floor(real) == real) {
		snprintf(text, size, "%.0f", real);
		return;
	}
	for (int digits = 6; digits <= 9; digits++) {
		snprintf(text, size, "%.*g", digits, real);
		if (strtof(text, NULL) == (float)real)
			break;
	}
	/* The reader accepts no + in bare words, and an exponent needs none. */
	plus = strchr(text, '+');
	if (plus)
		memmove(plus, plus + 1, strlen(plus));
}

/* In quotes. */
static void write_text(FILE *out, const char *text)
{
	fputc('"', out);
	for (; *text; text++) {
		if (*text == '"' || *text == '\\')
			fputc('\\', out);
		fputc(*text, out);
	}
	fputc('"', out);
}

static void write_value(FILE *out, const json_t *reg, const json_t *value, int width)
{
	const char *unit = db_words_text(reg, "unit");
	char about[DB_WORDS_VALUE_MAX];
	char number[64] = "";

	/* The text after a semicolon is for clients that write the register itself. */
	snprintf(about, sizeof(about), "%s%s%.*s", unit, unit[0] ? ", " : "",
	         (int)strcspn(db_words_text(reg, "description"), ";"),
	         db_words_text(reg, "description"));
	db_words_clean(about);
	if (!json_is_number(value)) {
		fprintf(out, "\t# %s: the drive does not tell it: %s\n", db_words_text(reg, "name"),
		        about);
		return;
	}
	db_params_write_number(value, number, sizeof(number));
	fprintf(out, "\t%-*s = %-10s # %s\n", width, db_words_text(reg, "name"), number, about);
}

char *db_params_write(const struct db_params *drive)
{
	char *text = NULL;
	size_t length = 0;
	FILE *out = open_memstream(&text, &length);
	int width = 0;
	size_t i;
	const json_t *reg;

	if (!out)
		return NULL;
	fputs("# Parameters of a drive. Into a drive: drivebridgectl params restore DRIVE "
	      "FILE\n\ndrive ",
	      out);
	write_text(out, drive->name);
	fprintf(out, " {\n\tformat   = " FORMAT "\n\tfamily   = %s\n\tidentity = ", drive->family);
	write_text(out, drive->identity);
	fputs("\n}\n\nparameters {\n", out);
	json_array_foreach(drive->registers, i, reg)
	{
		int letters = (int)strlen(db_words_text(reg, "name"));

		if (db_params_is_kept(reg) && letters > width)
			width = letters;
	}
	json_array_foreach(drive->registers, i, reg)
	{
		if (db_params_is_kept(reg))
			write_value(out, reg,
			            json_object_get(drive->values, db_words_text(reg, "name")),
			            width);
	}
	fputs("}\n\nend\n", out);
	if (fclose(out) == 0)
		return text;
	free(text);
	return NULL;
}

/* --- reading ---------------------------------------------------------------------------------- */

struct reading {
	struct db_params *params;
	struct db_reader reader;
	struct db_messages messages;
	struct db_source *source;
};

/* The one value of a key, or NULL and the reason is reported. */
static const char *value_of(struct reading *reading, const struct db_reader_key *key)
{
	if (!key->list && key->values)
		return key->values;
	db_messages_add_error(&reading->messages, key->line,
	                      "'%.40s' is a list; right is one value", key->name);
	return NULL;
}

/* The one section of that name, or DB_READER_NO_SECTION and the reason is reported. */
static size_t find_section(struct reading *reading, const char *name)
{
	size_t found = DB_READER_NO_SECTION;

	for (size_t i = 0; i < reading->reader.section_count; i++) {
		const struct db_reader_section *section = &reading->reader.sections[i];

		if (strcmp(section->name, name) != 0)
			continue;
		if (found != DB_READER_NO_SECTION)
			db_messages_add_error(&reading->messages, section->line,
			                      "there is a second section '%s'", name);
		found = i;
	}
	if (found == DB_READER_NO_SECTION)
		db_messages_add_error(&reading->messages, 0,
		                      "there is no section '%s': this is no file of parameters",
		                      name);
	return found;
}

/* Reports what is outside of both sections, or twice in one. */
static void check_form(struct reading *reading)
{
	const struct db_reader *reader = &reading->reader;

	for (size_t i = 0; i < reader->section_count; i++) {
		if (strcmp(reader->sections[i].name, "drive") != 0 &&
		    strcmp(reader->sections[i].name, "parameters") != 0)
			db_messages_add_error(
				&reading->messages, reader->sections[i].line,
				"there is no section '%.40s'; right is drive or parameters",
				reader->sections[i].name);
	}
	for (size_t i = 0; i < reader->key_count; i++) {
		const struct db_reader_key *key = &reader->keys[i];
		const struct db_reader_key *first = db_reader_find_key(reader, key->section,
		                                                       key->name);

		if (key->section == DB_READER_NO_SECTION)
			db_messages_add_error(&reading->messages, key->line,
			                      "'%.40s' stands outside of drive and parameters",
			                      key->name);
		else if (first != key)
			db_messages_add_error(&reading->messages, key->line,
			                      "'%.40s' is given twice, first on line %u", key->name,
			                      first->line);
	}
	if (!reading->source->ended)
		db_messages_add_error(&reading->messages, 0,
		                      "the last line is not 'end': a part of the file is missing");
}

static void read_head(struct reading *reading, size_t section)
{
	struct db_params *params = reading->params;
	const struct db_reader *reader = &reading->reader;
	bool has_format = false;

	for (size_t i = 0; i < reader->key_count; i++) {
		const struct db_reader_key *key = &reader->keys[i];
		const char *value = key->section == section ? value_of(reading, key) : NULL;

		if (!value)
			continue;
		if (strcmp(key->name, "format") == 0) {
			has_format = true;
			if (strcmp(value, FORMAT) != 0)
				db_messages_add_error(
					&reading->messages, key->line,
					"the format is %.20s; this program reads format %s", value,
					FORMAT);
		} else if (strcmp(key->name, "family") == 0) {
			snprintf(params->family, sizeof(params->family), "%s", value);
			params->family_line = key->line;
		} else if (strcmp(key->name, "identity") == 0) {
			snprintf(params->identity, sizeof(params->identity), "%s", value);
		} else {
			db_messages_add_error(
				&reading->messages, key->line,
				"a drive has no '%.40s'; right is format, family or identity",
				key->name);
		}
	}
	if (!has_format || params->family[0] == '\0')
		db_messages_add_error(&reading->messages, reader->sections[section].line,
		                      "the drive has no %s", has_format ? "family" : "format");
}

/* Without a register: any number. NULL and the reason is reported. */
static json_t *parse_number(struct reading *reading, const struct db_reader_key *key,
                            const char *text)
{
	char *end = NULL;
	long long whole;
	double real;

	errno = 0;
	whole = strtoll(text, &end, 10);
	if (*text && *end == '\0' && errno == 0)
		return json_integer(whole);
	real = strtod(text, &end);
	if (strpbrk(text, ".eE") && *end == '\0' && isfinite(real))
		return json_real(real);
	db_messages_add_error(&reading->messages, key->line, "%.40s: \"%.40s\" is no number",
	                      key->name, text);
	return NULL;
}

/* Reports that no parameter of that name can be in a file. */
static void refuse_parameter(struct reading *reading, const struct db_reader_key *key,
                             const json_t *reg)
{
	json_t *kept = json_array();
	char nearest[256];
	size_t i;
	json_t *item;

	if (reg && json_is_true(json_object_get(reg, "parameter"))) {
		db_messages_add_error(&reading->messages, key->line,
		                      "'%s' cannot be written from a file", key->name);
	} else {
		json_array_foreach(reading->params->registers, i, item)
		{
			if (db_params_is_kept(item))
				(void)json_array_append(kept, item);
		}
		db_words_nearest_names(kept, key->name, nearest, sizeof(nearest));
		db_messages_add_error(&reading->messages, key->line,
		                      "%s has no parameter '%.40s'%s", reading->params->family,
		                      key->name, nearest);
	}
	json_decref(kept);
}

static void read_parameter(struct reading *reading, const struct db_reader_key *key)
{
	struct db_params *params = reading->params;
	const char *text = value_of(reading, key);
	const json_t *reg = db_words_look_up(params->registers, key->name);
	char problem[256];
	json_t *value = NULL;

	if (!text)
		return;
	if (!params->registers) {
		value = parse_number(reading, key, text);
	} else if (!db_params_is_kept(reg)) {
		refuse_parameter(reading, key, reg);
	} else {
		value = db_words_parse_value(reg, text, problem, sizeof(problem));
		if (!value)
			db_messages_add_error(&reading->messages, key->line, "%s: %s", key->name,
			                      problem);
	}
	if (value)
		(void)json_object_set_new(params->values, key->name, value);
}

bool db_params_read(struct db_params *params, const char *path, const char *text,
                    const json_t *families, FILE *errors)
{
	static const struct db_reader_rules rules = { .sections = "drive or parameters" };
	struct reading reading = { .params = params, .source = db_sources_of_text(path, text) };
	size_t drive;
	size_t parameters;
	bool right;

	*params = (struct db_params){ .values = json_object() };
	snprintf(params->name, sizeof(params->name), "%s", path);
	if (!reading.source) {
		fprintf(errors, "%s: out of memory\n", path);
		return false;
	}
	reading.messages = (struct db_messages){ .sources = reading.source, .source_count = 1 };
	if (db_reader_read(&reading.reader, &rules, &reading.messages)) {
		check_form(&reading);
		drive = find_section(&reading, "drive");
		parameters = find_section(&reading, "parameters");
		if (drive != DB_READER_NO_SECTION)
			read_head(&reading, drive);
		params->registers = json_object_get(families, params->family);
		for (size_t i = 0; i < reading.reader.key_count; i++) {
			if (parameters != DB_READER_NO_SECTION &&
			    reading.reader.keys[i].section == parameters)
				read_parameter(&reading, &reading.reader.keys[i]);
		}
	}
	right = reading.messages.errors == 0;
	if (!right)
		db_messages_print(&reading.messages, errors);
	db_messages_clear(&reading.messages);
	db_reader_clear(&reading.reader);
	db_sources_free(reading.source, 1);
	return right;
}
