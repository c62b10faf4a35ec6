/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include "codec/secure_hello.h"
#include "drivebridge/command_table.h"
#include "drivebridge/result.h"
#include "identity/rights.h"

#include <arpa/inet.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Of the journal: never changed. */
#define MESSAGE_ID "6e3a4bb1f8d34bb0a0dcb7f36c9f1c55"

static const char *const kinds[DB_AUDIT_KIND_COUNT] = {
	[DB_AUDIT_COMMAND] = "command",   [DB_AUDIT_WRITE] = "write",
	[DB_AUDIT_END] = "end",           [DB_AUDIT_CONTROL] = "control",
	[DB_AUDIT_DENIED] = "denied",     [DB_AUDIT_RELOAD] = "reload",
	[DB_AUDIT_SET_UP] = "set-up",     [DB_AUDIT_LOGIN] = "login",
	[DB_AUDIT_USERS] = "users",       [DB_AUDIT_SERVICE] = "service",
	[DB_AUDIT_REPEATED] = "repeated", [DB_AUDIT_LOST] = "lost",
	[DB_AUDIT_TRAIL] = "trail",       [DB_AUDIT_ALARM] = "alarm",
	[DB_AUDIT_POSITION] = "position",
};

const char *db_audit_kind_name(enum db_audit_kind kind)
{
	return (unsigned)kind < DB_AUDIT_KIND_COUNT ? kinds[kind] : "unknown";
}

/* --- writing ---------------------------------------------------------------------------------- */

static void set_text(json_t *object, const char *key, const char *text)
{
	json_t *value;

	if (!text || text[0] == '\0')
		return;
	value = json_string(text);
	/* Bytes that are no UTF-8, of a drive or a user's name, are not worth a lost record. */
	(void)json_object_set_new(object, key, value ? value : json_string("?"));
}

static void set_members(json_t *object, const char *key, json_t *members)
{
	if (json_object_size(members) > 0)
		(void)json_object_set_new(object, key, members);
	else
		json_decref(members);
}

static void set_number(json_t *object, const char *key, uint64_t number)
{
	if (number != 0)
		(void)json_object_set_new(object, key, json_integer((json_int_t)number));
}

static json_t *value_of(enum db_type type, union db_value value)
{
	if (type == DB_F32)
		return json_real((double)value.f);
	return json_integer((json_int_t)db_value_number(type, value));
}

static json_t *arguments_of(const struct db_audit_entry *entry)
{
	const struct db_command_row *row = db_command_find(entry->command);
	json_t *arguments = json_object();

	for (size_t i = 0; row && i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		const struct db_arg_row *arg = &db_arg_rows[row->args[i]];
		const unsigned char *from = (const unsigned char *)&entry->args + arg->offset;
		size_t size = 2 * db_type_registers(arg->type);
		bool several = arg->bytes > size;
		json_t *words = several ? json_array() : NULL;

		for (size_t at = 0; at < arg->bytes; at += size) {
			union db_value value = { .u = 0 };
			uint16_t narrow;

			if (size == sizeof(narrow)) {
				memcpy(&narrow, from + at, sizeof(narrow));
				value.u = narrow;
			} else {
				memcpy(&value, from + at, sizeof(value));
			}
			if (several)
				(void)json_array_append_new(words, value_of(arg->type, value));
			else
				(void)json_object_set_new(arguments, arg->name,
				                          value_of(arg->type, value));
		}
		if (several)
			(void)json_object_set_new(arguments, arg->name, words);
	}
	return arguments;
}

/* In words for people; and what finds the same client again. */
static void set_who(json_t *object, const struct db_audit_entry *entry)
{
	struct db_client_session session;
	char login[DB_SECURE_NAME_MAX + 1] = "";
	char text[DB_CLIENT_TEXT_MAX];
	char digits[2 * sizeof(entry->address) + 1];
	char line[DB_CLIENT_LINE_NAME_MAX + 1];
	struct db_client_words words;
	uint32_t user;
	bool is_session = db_client_session_of_address(entry->address, &session);
	bool has_certificate = db_client_certificate_of_address(entry->address, &user);
	bool is_line = db_client_line_of_address(entry->address, line);

	if (entry->port == 0)
		return;
	if (!is_session && !has_certificate && !is_line &&
	    !db_client_user_of_address(entry->address, &user)) {
		db_client_address(entry->address, text);
		set_text(object, "address", text);
		set_number(object, "port", entry->port);
		return;
	}
	if (is_session || has_certificate)
		snprintf(login, sizeof(login), "%s", entry->login ? entry->login : "");
	else if (!is_line)
		db_rights_name(user, login);
	if (has_certificate)
		db_client_words_init_certificate(&words, entry->address, login,
		                                 entry->user ? entry->user : "");
	else
		db_client_words_init(&words, entry->address, login, entry->user ? entry->user : "");
	db_client_words_join(&words, text);
	for (size_t i = 0; i < sizeof(entry->address); i++)
		snprintf(digits + 2 * i, 3, "%02x", entry->address[i]);
	set_text(object, "who", text);
	set_text(object, "from", entry->from);
	set_number(object, "port", entry->port);
	set_text(object, "client", digits);
	set_text(object, "login", login);
	set_text(object, "user", entry->user);
}

json_t *db_record_write(const struct db_audit_entry *entry)
{
	json_t *object = json_object();
	json_t *values = json_object();

	if (!object) {
		json_decref(values);
		return NULL;
	}
	set_number(object, "number", entry->number);
	set_number(object, "time_us", entry->time_us);
	set_text(object, "kind", db_audit_kind_name(entry->kind));
	set_number(object, "of", entry->of);
	set_who(object, entry);
	set_text(object, "drive", entry->drive);
	set_text(object, "bus", entry->bus);
	set_number(object, "node", entry->node);
	set_number(object, "axis", entry->axis);
	set_number(object, "unit", entry->unit);
	set_text(object, "endpoint", entry->endpoint);
	set_text(object, "what",
	         entry->command != DB_CMD_NONE ? db_command_name(entry->command) : entry->what);
	if (entry->kind == DB_AUDIT_COMMAND)
		set_members(object, "arguments", arguments_of(entry));
	/* Each parameter with its value before, null where that is not known, and the new one. */
	for (size_t i = 0; i < entry->value_count; i++) {
		const struct db_audit_value *value = &entry->values[i];
		json_t *pair = json_array();

		(void)json_array_append_new(pair, value->known && !value->secret ?
		                                          value_of(value->type, value->old) :
		                                          json_null());
		(void)json_array_append_new(pair, value->secret ?
		                                          json_string("secret") :
		                                          value_of(value->type, value->new));
		(void)json_object_set_new(values, value->name, pair);
	}
	set_members(object, "values", values);
	set_number(object, "register", entry->first);
	set_number(object, "id", entry->id);
	set_text(object, "text", entry->text);
	set_number(object, "count", entry->count);
	if (entry->result != DB_RESULT_NONE)
		set_text(object, "result", db_result_name(entry->result));
	set_number(object, "took_us", entry->took_us);
	return object;
}

/* --- reading ---------------------------------------------------------------------------------- */

uint64_t db_record_number(const json_t *object, const char *key)
{
	json_int_t number = json_integer_value(json_object_get(object, key));

	return number > 0 ? (uint64_t)number : 0;
}

const char *db_record_text(const json_t *object, const char *key)
{
	const char *text = json_string_value(json_object_get(object, key));

	return text ? text : "";
}

static enum db_result result_named(const char *name)
{
	for (unsigned i = 0; i < DB_RESULT_COUNT; i++) {
		if (strcmp(db_result_name((enum db_result)i), name) == 0)
			return (enum db_result)i;
	}
	return DB_RESULT_NONE;
}

static void read_arguments(const json_t *arguments, struct db_audit_entry *entry)
{
	const struct db_command_row *row = db_command_find(entry->command);

	for (size_t i = 0; row && i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		const struct db_arg_row *arg = &db_arg_rows[row->args[i]];
		unsigned char *to = (unsigned char *)&entry->args + arg->offset;
		const json_t *found = json_object_get(arguments, arg->name);
		size_t size = 2 * db_type_registers(arg->type);
		size_t count = arg->bytes / size;

		for (size_t k = 0; k < count; k++) {
			const json_t *one = count > 1 ? json_array_get(found, k) : found;
			union db_value value;
			uint16_t narrow;

			if (!json_is_number(one) ||
			    !db_value_from_number(arg->type, json_number_value(one), &value))
				continue;
			narrow = (uint16_t)value.u;
			memcpy(to + k * size, size == sizeof(narrow) ? (void *)&narrow : &value,
			       size);
		}
	}
}

static bool read_who(const json_t *object, struct db_audit_entry *entry)
{
	static const uint8_t v4_prefix[12] = { [10] = 0xFF, [11] = 0xFF };
	const char *address = db_record_text(object, "address");
	const char *digits = db_record_text(object, "client");
	uint64_t port = db_record_number(object, "port");

	entry->port = port <= UINT16_MAX ? (uint16_t)port : 0;
	if (entry->port == 0)
		return true;
	if (address[0] != '\0') {
		memcpy(entry->address, v4_prefix, sizeof(v4_prefix));
		return inet_pton(AF_INET, address, entry->address + sizeof(v4_prefix)) == 1 ||
		       inet_pton(AF_INET6, address, entry->address) == 1;
	}
	if (strlen(digits) != 2 * sizeof(entry->address))
		return false;
	for (size_t i = 0; i < sizeof(entry->address); i++) {
		unsigned byte;

		if (sscanf(digits + 2 * i, "%2x", &byte) != 1)
			return false;
		entry->address[i] = (uint8_t)byte;
	}
	return true;
}

bool db_record_read(const json_t *object, struct db_audit_entry *entry,
                    struct db_audit_value *values)
{
	const char *kind = db_record_text(object, "kind");
	const struct db_command_row *row;
	const json_t *settings = json_object_get(object, "values");
	const char *name = json_object_iter_key(json_object_iter((json_t *)(uintptr_t)settings));
	unsigned place = 0;

	while (place < DB_AUDIT_KIND_COUNT && strcmp(kinds[place], kind) != 0)
		place++;
	*entry = (struct db_audit_entry){
		.kind = (enum db_audit_kind)place,
		.number = db_record_number(object, "number"),
		.time_us = db_record_number(object, "time_us"),
		.of = db_record_number(object, "of"),
		.count = db_record_number(object, "count"),
		.took_us = db_record_number(object, "took_us"),
		.result = result_named(db_record_text(object, "result")),
		.login = db_record_text(object, "login"),
		.user = db_record_text(object, "user"),
		.from = db_record_text(object, "from"),
		.endpoint = db_record_text(object, "endpoint"),
		.drive = db_record_text(object, "drive"),
		.bus = db_record_text(object, "bus"),
		.node = (uint16_t)db_record_number(object, "node"),
		.axis = (uint16_t)db_record_number(object, "axis"),
		.what = db_record_text(object, "what"),
		.text = db_record_text(object, "text"),
		.id = (uint16_t)db_record_number(object, "id"),
		.first = (uint16_t)db_record_number(object, "register"),
	};
	if (place == DB_AUDIT_KIND_COUNT || entry->number == 0 || !read_who(object, entry))
		return false;
	row = entry->kind == DB_AUDIT_COMMAND ? db_command_find_name(entry->what) : NULL;
	if (entry->kind == DB_AUDIT_COMMAND && !row)
		return false;
	if (row) {
		entry->command = (uint16_t)row->code;
		read_arguments(json_object_get(object, "arguments"), entry);
	}
	if (name) {
		const json_t *pair = json_object_get(settings, name);

		*values = (struct db_audit_value){
			.name = name,
			.number = json_number_value(json_array_get(pair, 1)),
			.secret = json_is_string(json_array_get(pair, 1)),
		};
		entry->values = values;
		entry->value_count = 1;
	}
	return true;
}

char *db_record_who(const json_t *object)
{
	const char *address = db_record_text(object, "address");
	const char *who = db_record_text(object, "who");
	const char *from = db_record_text(object, "from");
	char *text = NULL;
	int length;

	if (address[0] != '\0')
		length = asprintf(&text, "%s port %" PRIu64, address,
		                  db_record_number(object, "port"));
	else if (who[0] != '\0')
		length = asprintf(&text, "%s%s%s", who, from[0] ? ", " : "", from);
	else
		length = asprintf(&text, "drivebridged");
	return length < 0 ? NULL : text;
}

bool db_record_is_refused(const json_t *object)
{
	const char *kind = db_record_text(object, "kind");
	enum db_result result = result_named(db_record_text(object, "result"));

	return strcmp(kind, kinds[DB_AUDIT_DENIED]) == 0 ||
	       (result != DB_RESULT_NONE && result != DB_RESULT_PENDING &&
	        !db_result_is_success(result));
}

/* --- the journal ------------------------------------------------------------------------------ */

/* "feeder: move_absolute {"target_position": 64000}, by 192.168.10.5 port 51234: pending" */
static char *describe(const struct db_audit_entry *entry, const json_t *object, const char *who)
{
	static const char *const details[] = { "arguments", "values", "text" };
	const char *place = entry->drive && entry->drive[0] ? entry->drive :
	                    entry->bus && entry->bus[0]     ? entry->bus :
	                                                      "";
	const char *result = db_record_text(object, "result");
	char *detail = NULL;
	char *line = NULL;

	for (size_t i = 0; !detail && i < sizeof(details) / sizeof(details[0]); i++) {
		const json_t *found = json_object_get(object, details[i]);

		if (json_is_string(found))
			detail = strdup(json_string_value(found));
		else if (json_object_size(found) > 0)
			detail = json_dumps(found, JSON_REAL_PRECISION(9));
	}
	if (asprintf(&line, "audit %" PRIu64 ": %s%s%s%s%s%s%s, by %s%s%s", entry->number, place,
	             place[0] ? ": " : "", kinds[entry->kind],
	             db_record_text(object, "what")[0] ? " " : "", db_record_text(object, "what"),
	             detail ? " " : "", detail ? detail : "", who, result[0] ? ": " : "",
	             result) < 0)
		line = NULL;
	free(detail);
	return line;
}

static void add_field(char *fields[DB_RECORD_FIELDS_MAX], size_t *count, const char *name,
                      const char *value)
{
	if (value && value[0] != '\0' && asprintf(&fields[*count], "%s=%s", name, value) >= 0)
		(*count)++;
}

size_t db_record_fields(const struct db_audit_entry *entry, const json_t *object,
                        char *fields[DB_RECORD_FIELDS_MAX])
{
	char *who = db_record_who(object);
	char *line = who ? describe(entry, object, who) : NULL;
	char *all = json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(9));
	char number[24];
	size_t count = 0;

	snprintf(number, sizeof(number), "%" PRIu64, entry->number);
	add_field(fields, &count, "MESSAGE", line);
	add_field(fields, &count, "PRIORITY", "6");
	add_field(fields, &count, "MESSAGE_ID", MESSAGE_ID);
	add_field(fields, &count, "SYSLOG_IDENTIFIER", "drivebridged");
	add_field(fields, &count, "DRIVEBRIDGE_EVENT", "audit");
	add_field(fields, &count, "DRIVEBRIDGE_AUDIT", kinds[entry->kind]);
	add_field(fields, &count, "DRIVEBRIDGE_AUDIT_NUMBER", number);
	add_field(fields, &count, "DRIVEBRIDGE_AUDIT_RECORD", all);
	add_field(fields, &count, "DRIVEBRIDGE_CLIENT", who);
	add_field(fields, &count, "DRIVEBRIDGE_DRIVE", entry->drive);
	add_field(fields, &count, "DRIVEBRIDGE_BUS", entry->bus);
	free(who);
	free(line);
	free(all);
	return count;
}
