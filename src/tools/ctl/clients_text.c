/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/clients_text.h"
#include "ctl/session.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

const struct db_ctl_client_type *db_ctl_client_type(const json_t *reg)
{
	/* clang-format off */
	static const struct db_ctl_client_type types[] = {
		{ "u16",    1, "UINT16",  "uint16",  "uint16", "Word",  "HRUS",    "Int4",   "uint16",  "UInt",  "INT",  "UINT" },
		{ "i16",    1, "INT16",   "int16",   "int16",  "Short", "HR",      "Int2",   "int16",   "Int",   "INT",  "INT" },
		{ "bits16", 1, "UINT16",  "uint16",  "uint16", "Word",  "HRUS",    "Int4",   "uint16",  "Word",  "INT",  "WORD" },
		{ "u32",    2, "UINT32",  "uint32",  "uint32", "DWord", "HRUI",    "Int8",   "uint32",  "UDInt", "DINT", "UDINT" },
		{ "i32",    2, "INT32",   "int32",   "int32",  "Long",  "HRI",     "Int4",   "int32",   "DInt",  "DINT", "DINT" },
		{ "bits32", 2, "UINT32",  "uint32",  "uint32", "DWord", "HRUI",    "Int8",   "uint32",  "DWord", "DINT", "DWORD" },
		{ "f32",    2, "FLOAT32", "float32", "float",  "Float", "HRF",     "Float4", "float32", "Real",  "REAL", "REAL" },
		{ "u64",    4, "UINT64",  "uint64",  "uint64", "QWord", "HRUI_64", "Int8",   "uint64",  "ULInt", "LINT", "ULINT" },
	};
	/* clang-format on */
	const char *type = db_words_text(reg, "type");

	if (strcmp(db_words_text(reg, "table"), "holding") != 0)
		return NULL;
	for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++) {
		if (strcmp(types[i].type, type) == 0)
			return &types[i];
	}
	return NULL;
}

const json_t *db_ctl_next_of_window(const struct db_ctl_clients *of, size_t drive, size_t *at,
                                    const char **name)
{
	char prefix[32];

	snprintf(prefix, sizeof(prefix), "window%zu_", drive + 1);
	for (; *at < json_array_size(of->windows); ++*at) {
		const json_t *reg = json_array_get(of->windows, *at);

		if (strncmp(db_words_text(reg, "name"), prefix, strlen(prefix)) != 0)
			continue;
		++*at;
		*name = db_words_text(reg, "name") + strlen(prefix);
		return reg;
	}
	return NULL;
}

const char *db_ctl_drive_name(const struct db_ctl_clients *of, size_t drive)
{
	return db_words_text(json_array_get(of->drives, drive), "name");
}

const json_t *db_ctl_drive_register(const struct db_ctl_clients *of, size_t drive, const char *name)
{
	const json_t *registers = json_array_get(of->registers, drive);
	size_t i;
	const json_t *reg;

	/* Bits have a table of their own; some have the name of a register. */
	json_array_foreach(registers, i, reg)
	{
		if (strcmp(db_words_text(reg, "name"), name) == 0)
			return reg;
	}
	return NULL;
}

const char *db_ctl_unit_of(const json_t *reg)
{
	const char *unit = db_words_text(reg, "unit");

	return strncmp(unit, "user units", strlen("user units")) == 0 ? "" : unit;
}

void db_ctl_describe(const json_t *reg, char text[DB_CTL_DESCRIPTION_MAX])
{
	const char *before = strncmp(db_words_text(reg, "type"), "bits", 4) == 0 ? "; bits:" : ":";
	size_t used = (size_t)snprintf(text, DB_CTL_DESCRIPTION_MAX, "%s",
	                               db_words_text(reg, "description"));
	const char *code;
	json_t *name;

	json_object_foreach(json_object_get(reg, "codes"), code, name)
	{
		if (used < DB_CTL_DESCRIPTION_MAX)
			used += (size_t)snprintf(text + used, DB_CTL_DESCRIPTION_MAX - used,
			                         "%s %s=%s", before, code, json_string_value(name));
		before = "";
	}
}

const struct db_ctl_figure db_ctl_gateway_figures[] = {
	{ "drive_count", false }, { "drives_online", false }, { "uptime_s", true },
	{ "clients", false },     { "requests", true },       { "exceptions", true },
	{ NULL, false },
};

const struct db_ctl_figure db_ctl_bus_figures[] = {
	{ "up", false },           { "utilisation", false }, { "overruns", true },
	{ "retries", true },       { "timeouts", true },     { "bad_frames", true },
	{ "garbage_bytes", true }, { NULL, false },
};

const json_t *db_ctl_figure(const struct db_ctl_clients *of, const struct db_ctl_figure *figure,
                            size_t bus)
{
	char name[64];

	snprintf(name, sizeof(name), "bus%zu_%s", bus, figure->name);
	return db_words_look_up(of->gateway, bus > 0 ? name : figure->name);
}

void db_ctl_put_quoted(FILE *out, const char *text)
{
	json_t *string = json_string(text);
	char *quoted = json_dumps(string, JSON_ENCODE_ANY);

	fputs(quoted ? quoted : "\"\"", out);
	free(quoted);
	json_decref(string);
}

static void make_identifier(char *text, size_t size, const char *name)
{
	size_t used = 0;

	if (!isalpha((unsigned char)name[0]))
		used = (size_t)snprintf(text, size, "Drive_");
	for (; *name && used + 1 < size; name++) {
		char letter = isalnum((unsigned char)*name) ? *name : '_';

		/* IEC 61131-3 allows neither two underscores in a row nor one at the end. */
		if (letter != '_' || (used > 0 && text[used - 1] != '_'))
			text[used++] = letter;
	}
	while (used > 1 && text[used - 1] == '_')
		used--;
	text[used] = '\0';
}

void db_ctl_put_identifier(FILE *out, const struct db_ctl_clients *of, size_t drive)
{
	char own[128];
	char other[128];
	bool doubled = false;

	make_identifier(own, sizeof(own), db_ctl_drive_name(of, drive));
	for (size_t i = 0; i < drive; i++) {
		make_identifier(other, sizeof(other), db_ctl_drive_name(of, i));
		doubled = doubled || strcasecmp(own, other) == 0;
	}
	fputs(own, out);
	if (doubled)
		fprintf(out, "_%lld",
		        json_integer_value(
				json_object_get(json_array_get(of->drives, drive), "unit")));
}
