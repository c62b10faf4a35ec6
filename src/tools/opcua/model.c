/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/model.h"
#include "words/value.h"

#include <ctype.h>
#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Tables write the largest float with ten digits, which is less than it. */
#define FLOAT_END (0.999999 * (double)FLT_MAX)

#define QUALITY_GOOD 192
#define QUALITY_UNCERTAIN 64

/* --- kinds ------------------------------------------------------------------------------------ */

const char *db_opcua_group_folder(enum db_opcua_group group)
{
	static const char *const folders[DB_OPCUA_GROUPS] = {
		[DB_OPCUA_PROCESS] = "",
		[DB_OPCUA_COMMAND] = "CommandBlock",
		[DB_OPCUA_PARAMETERS] = "Parameters",
		[DB_OPCUA_SERVICE] = "Service",
		[DB_OPCUA_BITS] = "Bits",
		[DB_OPCUA_HISTORY] = "History",
		[DB_OPCUA_DIAGNOSIS] = "Diagnosis",
	};

	return folders[group];
}

static bool read_type(const char *name, enum db_opcua_type *type, bool *bits)
{
	static const struct {
		const char *name;
		enum db_opcua_type type;
		bool bits;
	} types[] = {
		{ "bool", DB_OPCUA_BOOL, false }, { "u16", DB_OPCUA_U16, false },
		{ "i16", DB_OPCUA_I16, false },   { "u32", DB_OPCUA_U32, false },
		{ "i32", DB_OPCUA_I32, false },   { "u64", DB_OPCUA_U64, false },
		{ "f32", DB_OPCUA_F32, false },   { "bits16", DB_OPCUA_U16, true },
		{ "bits32", DB_OPCUA_U32, true }, { "text", DB_OPCUA_TEXT, false },
	};

	for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++) {
		if (strcmp(types[i].name, name) == 0) {
			*type = types[i].type;
			*bits = types[i].bits;
			return true;
		}
	}
	return false;
}

/* Variables for what is wrong. Those of the gateway concern its configuration, except the first
 * one. */
static const struct {
	const char *name;
	const char *type;
	bool of_drives;
	bool of_gateway;
	const char *description;
} diagnosis[] = {
	{ "well", "bool", false, true,
	  "All is well: no drive, bus or configuration needs attention" },
	{ "cause", "text", true, true, "What is wrong, the worst of it, in one word; none" },
	{ "need", "text", true, true,
	  "What somebody has to do: nothing, hint (all is well), look, act" },
	{ "detail", "text", true, false, "Of a fault its name, of a port the system's error" },
	{ "advice", "text", true, true, "What to do" },
	{ "since_us", "u64", true, true,
	  "Since when, microseconds since 1970-01-01 UTC; 0 where nothing is wrong" },
	{ "event", "text", true, true, "The latest event about it" },
	{ "event_time_us", "u64", true, true, "When that was, microseconds since 1970-01-01 UTC" },
	{ "errors", "text", false, true,
	  "What is wrong with the configuration's files, a line each" },
};
#define DIAGNOSIS_COUNT (sizeof(diagnosis) / sizeof(diagnosis[0]))

/* "event" is "configuration_event" of the gateway. */
static void name_diagnosis(size_t place, bool gateway, char name[DB_OPCUA_NAME_MAX])
{
	snprintf(name, DB_OPCUA_NAME_MAX, "%s%s", gateway && place > 0 ? "configuration_" : "",
	         diagnosis[place].name);
}

void db_opcua_registers_add_diagnosis(json_t *registers, bool gateway)
{
	char name[DB_OPCUA_NAME_MAX];

	for (size_t i = 0; i < DIAGNOSIS_COUNT; i++) {
		if (gateway ? !diagnosis[i].of_gateway : !diagnosis[i].of_drives)
			continue;
		name_diagnosis(i, gateway, name);
		(void)json_array_append_new(registers,
		                            json_pack("{s:s, s:s, s:b, s:s}", "name", name, "type",
		                                      diagnosis[i].type, "diagnosis", true,
		                                      "description", diagnosis[i].description));
	}
}

const struct db_opcua_output db_opcua_outputs[DB_OPCUA_OUTPUTS_COUNT] = {
	{ "Result", "How it ended: ok, unproven (taken, and its protocol shows no more), pending "
	            "(it goes on)" },
	{ "Reason", "Why it was refused, in words; empty when it was not" },
};

static bool is_history(const char *name)
{
	static const char head[] = "history";

	return strncmp(name, head, sizeof(head) - 1) == 0 &&
	       isdigit((unsigned char)name[sizeof(head) - 1]);
}

static bool is_argument(const json_t *commands, const char *name)
{
	size_t i;
	const json_t *command;

	if (strcmp(name, "command") == 0 || strcmp(name, "command_id") == 0 ||
	    strcmp(name, "staged_command") == 0)
		return true;
	json_array_foreach(commands, i, command)
	{
		size_t a;
		const json_t *argument;

		json_array_foreach(json_object_get(command, "arguments"), a, argument)
		{
			if (strcmp(json_string_value(argument), name) == 0)
				return true;
		}
	}
	return false;
}

/* Registers are in the order of their addresses: process data, the command block, parameters, what
 * the service knows, the history; then single bits. */
static enum db_opcua_group group_of(const struct db_opcua_register *reg, bool parameter,
                                    const json_t *commands, enum db_opcua_group before)
{
	if (is_history(reg->name))
		return DB_OPCUA_HISTORY;
	if (reg->type == DB_OPCUA_BOOL)
		return DB_OPCUA_BITS;
	if (parameter)
		return DB_OPCUA_PARAMETERS;
	if (before >= DB_OPCUA_PARAMETERS)
		return DB_OPCUA_SERVICE;
	if (is_argument(commands, reg->name))
		return DB_OPCUA_COMMAND;
	/* The command block also has arguments of commands that this drive does not have. */
	return before;
}

static bool read_register(struct db_opcua_register *reg, const json_t *json, const json_t *commands,
                          enum db_opcua_group before)
{
	const json_t *min = json_object_get(json, "min");
	const json_t *max = json_object_get(json, "max");
	bool parameter = json_is_true(json_object_get(json, "parameter"));

	reg->name = db_words_text(json, "name");
	reg->unit = db_words_text(json, "unit");
	reg->description = db_words_text(json, "description");
	reg->writable = json_is_true(json_object_get(json, "writable"));
	reg->codes = json_object_get(json, "codes");
	if (!json_is_object(reg->codes))
		reg->codes = NULL;
	if (reg->name[0] == '\0' || !read_type(db_words_text(json, "type"), &reg->type, &reg->bits))
		return false;
	reg->has_range = json_is_number(min) && json_is_number(max);
	if (reg->has_range) {
		reg->min = json_number_value(min);
		reg->max = json_number_value(max);
	}
	reg->group = json_is_true(json_object_get(json, "diagnosis")) ?
	                     DB_OPCUA_DIAGNOSIS :
	                     group_of(reg, parameter, commands, before);
	reg->own = db_opcua_name_is_own(reg->name) || reg->group == DB_OPCUA_COMMAND ||
	           reg->group == DB_OPCUA_SERVICE || reg->group == DB_OPCUA_HISTORY ||
	           reg->group == DB_OPCUA_DIAGNOSIS;
	/* A parameter keeps its vendor's name. */
	if (parameter)
		snprintf(reg->shown, sizeof(reg->shown), "%s", reg->name);
	else
		db_opcua_name_of(reg->name, reg->shown);
	return true;
}

bool db_opcua_register_is_open(const struct db_opcua_register *reg)
{
	switch (reg->type) {
	case DB_OPCUA_U16:
		return reg->max >= UINT16_MAX;
	case DB_OPCUA_I16:
		return reg->min <= INT16_MIN || reg->max >= INT16_MAX;
	case DB_OPCUA_U32:
		return reg->max >= UINT32_MAX;
	case DB_OPCUA_I32:
		return reg->min <= INT32_MIN || reg->max >= INT32_MAX;
	case DB_OPCUA_F32:
		return reg->min <= -FLOAT_END || reg->max >= FLOAT_END;
	default:
		return false;
	}
}

/* By where the type has a member of this name. */
static const struct db_opcua_type_row *find_data(const struct db_opcua_kind *kind,
                                                 enum db_opcua_group group, const char *shown)
{
	const char *folder = db_opcua_group_folder(group);
	char path[2 * DB_OPCUA_NAME_MAX];

	snprintf(path, sizeof(path), "%s%s%s", folder, folder[0] ? "." : "", shown);
	return db_opcua_type_data(db_opcua_type_member(kind->type, path));
}

/* The bits of the status register have its quality. */
static void mark_own_bits(struct db_opcua_kind *kind)
{
	json_t *codes = NULL;

	for (size_t i = 0; i < kind->count; i++) {
		if (strcmp(kind->list[i].name, "status") == 0)
			codes = kind->list[i].codes;
	}
	for (size_t i = 0; codes && i < kind->count; i++) {
		struct db_opcua_register *reg = &kind->list[i];
		const char *number;
		const json_t *name;

		json_object_foreach(codes, number, name)
		{
			if (reg->group == DB_OPCUA_BITS &&
			    strcmp(json_string_value(name), reg->name) == 0)
				reg->own = true;
		}
	}
}

/* history12_result is index 11 of the column Result. */
static bool add_to_column(struct db_opcua_kind *kind, size_t place)
{
	struct db_opcua_register *reg = &kind->list[place];
	struct db_opcua_column *column = kind->columns;
	char shown[DB_OPCUA_NAME_MAX];
	char *field;
	unsigned long number = strtoul(reg->name + strcspn(reg->name, "0123456789"), &field, 10);

	if (number == 0 || number > DB_OPCUA_HISTORY_MAX || *field != '_')
		return true;
	db_opcua_name_of(field + 1, shown);
	while (column < kind->columns + kind->column_count && strcmp(column->shown, shown) != 0)
		column++;
	if (column == kind->columns + kind->column_count) {
		struct db_opcua_column *grown = realloc(kind->columns,
		                                        (kind->column_count + 1) * sizeof(*grown));

		if (!grown)
			return false;
		kind->columns = grown;
		column = &grown[kind->column_count++];
		*column = (struct db_opcua_column){ .first = reg };
		reg->data = find_data(kind, DB_OPCUA_HISTORY, shown);
		memcpy(column->shown, shown, sizeof(shown));
	}
	column->places[number - 1] = place;
	if (number > column->count)
		column->count = number;
	return true;
}

static void free_kind(struct db_opcua_kind *kind)
{
	if (!kind)
		return;
	json_decref(kind->registers);
	json_decref(kind->commands);
	free(kind->list);
	free(kind->by_name);
	free(kind->columns);
	free(kind);
}

static int compare_names(const void *a, const void *b)
{
	const struct db_opcua_register *const *left = a;
	const struct db_opcua_register *const *right = b;

	return strcmp((*left)->name, (*right)->name);
}

static struct db_opcua_kind *make_kind(const struct db_opcua_type_row *type, json_t *registers,
                                       json_t *commands)
{
	struct db_opcua_kind *kind = calloc(1, sizeof(*kind));
	enum db_opcua_group before = DB_OPCUA_PROCESS;
	size_t i;
	const json_t *json;

	if (!kind)
		return NULL;
	kind->type = type;
	kind->registers = json_incref(registers);
	kind->commands = json_incref(commands);
	kind->list = calloc(json_array_size(registers) + 1, sizeof(*kind->list));
	kind->by_name = calloc(json_array_size(registers) + 1, sizeof(struct db_opcua_register *));
	if (!kind->list || !kind->by_name) {
		free_kind(kind);
		return NULL;
	}
	json_array_foreach(registers, i, json)
	{
		struct db_opcua_register *reg = &kind->list[kind->count];

		/* A register type of a newer service is left out, and the arguments of commands
		 * that this drive does not have: every command block has them. */
		if (read_register(reg, json, commands, before)) {
			before = reg->group;
			if (reg->group != DB_OPCUA_COMMAND || is_argument(commands, reg->name)) {
				if (reg->group != DB_OPCUA_HISTORY)
					reg->data = find_data(kind, reg->group, reg->shown);
				kind->count++;
				continue;
			}
		}
		*reg = (struct db_opcua_register){ .name = NULL };
	}
	mark_own_bits(kind);
	for (i = 0; i < kind->count; i++)
		kind->by_name[i] = &kind->list[i];
	qsort(kind->by_name, kind->count, sizeof(*kind->by_name), compare_names);
	for (i = 0; i < kind->count; i++) {
		if (kind->list[i].group == DB_OPCUA_HISTORY && !add_to_column(kind, i)) {
			free_kind(kind);
			return NULL;
		}
	}
	return kind;
}

void db_opcua_registers_shorten(json_t *registers, bool history)
{
	static const char first[] = "history1_";
	static const char *const others[] = { "table", "address", "default", "traits" };

	for (size_t i = json_array_size(registers); i-- > 0;) {
		json_t *reg = json_array_get(registers, i);
		const char *name = db_words_text(reg, "name");

		for (size_t j = 0; j < sizeof(others) / sizeof(others[0]); j++)
			(void)json_object_del(reg, others[j]);
		if (is_history(name) && !history)
			(void)json_array_remove(registers, i);
		else if (is_history(name) && strncmp(name, first, sizeof(first) - 1) != 0)
			(void)json_array_set_new(registers, i,
			                         json_pack("{s:s, s:s}", "name", name, "type",
			                                   db_words_text(reg, "type")));
	}
}

struct db_opcua_kind *db_opcua_kind_take(struct db_opcua_kind **kinds,
                                         const struct db_opcua_type_row *type, json_t *registers,
                                         json_t *commands)
{
	struct db_opcua_kind *kind = *kinds;

	if (!json_is_array(registers) || !json_is_array(commands))
		return NULL;
	while (kind && !(kind->type == type && json_equal(kind->registers, registers) &&
	                 json_equal(kind->commands, commands)))
		kind = kind->next;
	if (!kind) {
		kind = make_kind(type, registers, commands);
		if (!kind)
			return NULL;
		kind->number = *kinds ? (*kinds)->number + 1 : 1;
		kind->next = *kinds;
		*kinds = kind;
	}
	kind->users++;
	return kind;
}

struct db_opcua_register *db_opcua_kind_find(const struct db_opcua_kind *kind, const char *name)
{
	const struct db_opcua_register named = { .name = name };
	const struct db_opcua_register *key = &named;
	struct db_opcua_register *const *found = bsearch(&key, kind->by_name, kind->count,
	                                                 sizeof(*found), compare_names);

	return found ? *found : NULL;
}

void db_opcua_kind_release(struct db_opcua_kind **kinds, struct db_opcua_kind *kind)
{
	struct db_opcua_kind **at = kinds;

	if (!kind || --kind->users > 0)
		return;
	while (*at && *at != kind)
		at = &(*at)->next;
	if (*at)
		*at = kind->next;
	free_kind(kind);
}

/* --- drives ----------------------------------------------------------------------------------- */

struct db_opcua_drive *db_opcua_drive_new(const char *name, const char *bus,
                                          struct db_opcua_kind *kind)
{
	struct db_opcua_drive *drive = calloc(1, sizeof(*drive));

	if (!drive)
		return NULL;
	drive->items = calloc(kind->count + 1, sizeof(*drive->items));
	if (!drive->items) {
		free(drive);
		return NULL;
	}
	snprintf(drive->name, sizeof(drive->name), "%s", name);
	snprintf(drive->bus, sizeof(drive->bus), "%s", bus);
	drive->kind = kind;
	for (size_t i = 0; i < kind->count; i++) {
		drive->items[i].drive = drive;
		drive->items[i].reg = &kind->list[i];
	}
	return drive;
}

void db_opcua_drive_free(struct db_opcua_kind **kinds, struct db_opcua_drive *drive)
{
	if (!drive)
		return;
	for (size_t i = 0; i < drive->kind->count; i++) {
		if (drive->items[i].reg->type == DB_OPCUA_TEXT)
			free(drive->items[i].value.text);
	}
	db_opcua_kind_release(kinds, drive->kind);
	free(drive->items);
	free(drive);
}

void db_opcua_drive_take_watchers(struct db_opcua_drive *drive, const struct db_opcua_drive *before)
{
	for (size_t i = 0; i < before->kind->count; i++) {
		const struct db_opcua_item *watched = &before->items[i];
		struct db_opcua_item *item = db_opcua_drive_find(drive, watched->reg->name);

		if (item)
			item->watchers = watched->watchers;
	}
}

struct db_opcua_item *db_opcua_drive_find(const struct db_opcua_drive *drive, const char *reg)
{
	const struct db_opcua_register *found = db_opcua_kind_find(drive->kind, reg);

	return found ? &drive->items[found - drive->kind->list] : NULL;
}

/* --- values ----------------------------------------------------------------------------------- */

static bool read_value(enum db_opcua_type type, const json_t *json, struct db_opcua_value *value)
{
	switch (type) {
	case DB_OPCUA_BOOL:
		value->flag = json_is_boolean(json) ? json_is_true(json) :
		                                      json_number_value(json) != 0.0;
		return json_is_boolean(json) || json_is_number(json);
	case DB_OPCUA_F32:
		value->real = (float)json_number_value(json);
		return json_is_number(json);
	case DB_OPCUA_I16:
	case DB_OPCUA_I32:
		value->whole = json_integer_value(json);
		return json_is_integer(json);
	case DB_OPCUA_TEXT:
		value->text = json_is_string(json) ? strdup(json_string_value(json)) : NULL;
		return value->text != NULL;
	case DB_OPCUA_U16:
	case DB_OPCUA_U32:
	case DB_OPCUA_U64:
	default:
		value->number = (uint64_t)json_integer_value(json);
		return json_is_integer(json);
	}
}

static bool is_same(enum db_opcua_type type, const struct db_opcua_value *a,
                    const struct db_opcua_value *b)
{
	if (a->known != b->known)
		return false;
	if (!a->known)
		return true;
	switch (type) {
	case DB_OPCUA_BOOL:
		return a->flag == b->flag;
	case DB_OPCUA_F32:
		return !(a->real < b->real) && !(a->real > b->real);
	case DB_OPCUA_TEXT:
		return a->text && b->text && strcmp(a->text, b->text) == 0;
	default:
		return a->number == b->number;
	}
}

static void take_value(struct db_opcua_item *item, const json_t *json, int64_t time_us)
{
	struct db_opcua_value fresh = { .known = false, .number = 0 };
	enum db_opcua_type type = item->reg->type;

	fresh.known = read_value(type, json, &fresh);
	fresh.since_us = time_us;
	if (is_same(type, &item->value, &fresh))
		fresh.since_us = item->value.since_us;
	if (type == DB_OPCUA_TEXT)
		free(item->value.text);
	item->value = fresh;
}

void db_opcua_drive_take(struct db_opcua_drive *drive, json_t *values, int64_t time_us)
{
	const json_t *quality = json_object_get(values, "quality");
	const char *name;
	const json_t *json;

	if (time_us > 0)
		drive->time_us = time_us;
	if (json_is_integer(quality))
		drive->quality = (unsigned)json_integer_value(quality);
	json_object_foreach(values, name, json)
	{
		struct db_opcua_item *item = db_opcua_drive_find(drive, name);

		if (item)
			take_value(item, json, drive->time_us);
	}
}

/* Takes the value over. */
static void diagnose(struct db_opcua_drive *drive, size_t place, json_t *value, int64_t us)
{
	char name[DB_OPCUA_NAME_MAX];
	struct db_opcua_item *item;

	name_diagnosis(place, drive->name[0] == '\0', name);
	item = db_opcua_drive_find(drive, name);
	if (item && item->reg->group == DB_OPCUA_DIAGNOSIS)
		take_value(item, value, us);
	json_decref(value);
}

/* "a\nb" */
static json_t *join_lines(const json_t *lines)
{
	json_t *text = json_string("");
	size_t i;
	const json_t *line;

	json_array_foreach(lines, i, line)
	{
		json_t *longer = json_sprintf("%s%s%s", json_string_value(text), i > 0 ? "\n" : "",
		                              json_string_value(line));

		json_decref(text);
		text = longer;
	}
	return text;
}

void db_opcua_drive_diagnose(struct db_opcua_drive *drive, const json_t *record, int64_t us)
{
	const json_t *event = json_object_get(record, "event");

	for (size_t i = 0; i < DIAGNOSIS_COUNT; i++) {
		const char *key = diagnosis[i].name;
		json_t *value = json_object_get(record, key);

		if (strcmp(key, "event") == 0)
			diagnose(drive, i, json_string(db_words_text(event, "text")), us);
		else if (strcmp(key, "event_time_us") == 0)
			diagnose(
				drive, i,
				json_integer(json_integer_value(json_object_get(event, "time_us"))),
				us);
		else if (strcmp(key, "errors") == 0)
			diagnose(drive, i, join_lines(value), us);
		else if (value)
			diagnose(drive, i, json_incref(value), us);
	}
}

void db_opcua_gateway_diagnose(struct db_opcua_drive *gateway, const json_t *configuration,
                               bool well, int64_t us)
{
	db_opcua_drive_diagnose(gateway, configuration, us);
	diagnose(gateway, 0, json_boolean(well), us);
}

enum db_opcua_quality db_opcua_drive_quality(const struct db_opcua_drive *drive)
{
	if (drive->lost)
		return DB_OPCUA_NO_CONTACT;
	return drive->late ? DB_OPCUA_UNCERTAIN : DB_OPCUA_GOOD;
}

enum db_opcua_quality db_opcua_item_quality(const struct db_opcua_item *item)
{
	const struct db_opcua_drive *drive = item->drive;
	enum db_opcua_quality told = db_opcua_drive_quality(drive);

	if (drive->lost)
		return told;
	if (item->reg->own || drive->name[0] == '\0')
		return item->value.known ? told : DB_OPCUA_NOTHING_YET;
	if (drive->time_us == 0 || !item->value.known)
		return drive->quality == QUALITY_GOOD || drive->time_us == 0 ?
		               DB_OPCUA_NOTHING_YET :
		               DB_OPCUA_NO_CONTACT;
	if (drive->quality >= QUALITY_GOOD)
		return told;
	return drive->quality >= QUALITY_UNCERTAIN ? DB_OPCUA_UNCERTAIN : DB_OPCUA_NO_CONTACT;
}

json_t *db_opcua_group_names(const struct db_opcua_kind *kind, enum db_opcua_group group,
                             bool streamed)
{
	json_t *names = json_array();

	for (size_t i = 0; i < kind->count; i++) {
		const struct db_opcua_register *reg = &kind->list[i];
		bool quality = strcmp(reg->name, "quality") == 0;

		/* Every stream includes the quality. */
		if (!streamed && (reg->streamed || quality))
			continue;
		if (reg->group == group || quality || strcmp(reg->name, "timestamp_us") == 0)
			(void)json_array_append_new(names, json_string(reg->name));
	}
	return names;
}
