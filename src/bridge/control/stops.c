/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/act.h"
#include "drivebridge/command_table.h"
#include "regmap/named.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CONTROL "io.drivebridge.Control."
#define NO_DRIVE DB_NAMED_GATEWAY
/* Maximum number of names in a call; more than there can be drives. */
#define NAMES_MAX 1024
#define WAIT_MS_MAX 60000
#define WAIT_MS 5000 /* default */

/* --- what is a stop --------------------------------------------------------------------------- */

/* A stop by its name or its code, as a register's value may be written; DB_CMD_NONE: no stop. */
static enum db_command find_stop(const json_t *command)
{
	json_int_t code = json_integer_value(command);

	if (json_is_string(command)) {
		const struct db_command_row *row = db_command_find_name(json_string_value(command));

		code = row ? (json_int_t)row->code : 0;
	}
	if (code <= 0 || code >= DB_CMD_LIMIT || !db_command_is_stop((enum db_command)code))
		return DB_CMD_NONE;
	return (enum db_command)code;
}

bool db_stops_has_place(const struct db_message *message)
{
	const char *method = message->method;

	if (strncmp(method, CONTROL, strlen(CONTROL)) != 0)
		return false;
	method += strlen(CONTROL);
	if (strcmp(method, "Run") == 0)
		return find_stop(json_object_get(message->parameters, "command")) != DB_CMD_NONE;
	if (strcmp(method, "Write") == 0) {
		const json_t *values = json_object_get(message->parameters, "values");
		const char *drive = json_string_value(
			json_object_get(message->parameters, "drive"));

		if (drive && drive[0] == '\0')
			return json_object_get(values, "group_stop") ||
			       json_object_get(values, "group_stop_units");
		return find_stop(json_object_get(values, "command")) != DB_CMD_NONE;
	}
	return strcmp(method, "Stop") == 0 || strcmp(method, "Introduce") == 0;
}

/* --- Stop ------------------------------------------------------------------------------------- */

/* One drive of a Stop. It may be removed by a reload before its stop has ended. */
struct part {
	char name[64];
	uint16_t drive;    /* NO_DRIVE: there is none of that name */
	uint32_t sequence; /* number of its answer */
	bool ended;
	bool told;
	enum db_result result;
};

struct db_stops {
	size_t count;
	size_t left; /* number of parts that have not ended */
	struct part parts[];
};

/* Reports the parts that ended since the last answer, if the caller wants to know before all
 * have. */
static void report(struct db_session *session)
{
	struct db_stops *stops = session->job;
	bool last = stops->left == 0;
	json_t *list;

	if (!last && !session->more)
		return;
	list = json_array();
	for (size_t i = 0; i < stops->count; i++) {
		struct part *part = &stops->parts[i];
		json_t *one;

		if (!part->ended || part->told)
			continue;
		part->told = true;
		if (part->drive == NO_DRIVE)
			one = json_pack("{s:s, s:s, s:o}", "drive", part->name, "result",
			                "no_such_drive", "reason",
			                json_sprintf("no drive is called \"%s\"", part->name));
		else if (part->result == DB_RESULT_OK)
			one = json_pack("{s:s, s:s}", "drive", part->name, "result", "ok");
		else
			one = json_pack("{s:s, s:s, s:s}", "drive", part->name, "result",
			                db_result_name(part->result), "reason",
			                db_act_reason_of(part->result));
		(void)json_array_append_new(list, one);
	}
	if (last || json_array_size(list) > 0)
		db_session_reply(session, json_pack("{s:o}", "stopped", list), !last);
	else
		json_decref(list);
}

static void end_part(struct db_stops *stops, struct part *part, enum db_result result)
{
	part->ended = true;
	part->result = result;
	stops->left--;
}

static void add_part(struct db_stops *stops, const char *name, uint16_t number)
{
	struct part *part = &stops->parts[stops->count++];

	part->drive = number;
	snprintf(part->name, sizeof(part->name), "%s", name);
}

/* The named drives, or all. Null when out of memory. */
static struct db_stops *list_parts(const struct db_registers *registers, const json_t *names)
{
	size_t named = json_array_size(names);
	size_t present = db_named_drive_count(registers);
	struct db_stops *stops = calloc(1, sizeof(*stops) + (named > 0 ? named : present) *
	                                                            sizeof(stops->parts[0]));
	struct db_named_drive drive;

	for (size_t i = 0; stops && i < named; i++) {
		const char *name = json_string_value(json_array_get(names, i));

		add_part(stops, name,
		         db_named_drive_find(registers, name, &drive) ? drive.number : NO_DRIVE);
	}
	for (size_t i = 0; stops && named == 0 && i < present; i++) {
		if (db_named_drive_at(registers, i, &drive))
			add_part(stops, drive.config->name, drive.number);
	}
	return stops;
}

/* DB_CMD_NONE when the call was answered already. */
static enum db_command take_command(const struct db_call *call)
{
	const json_t *wanted = json_object_get(call->parameters, "command");
	enum db_command command = DB_CMD_NONE;

	if (!wanted || json_is_null(wanted))
		return DB_CMD_STOP;
	if (json_is_string(wanted))
		command = find_stop(wanted);
	if (command == DB_CMD_NONE)
		db_session_fail_value(call->session, "command",
		                      "it is stop, quick_stop or disable");
	return command;
}

void db_stops_call(const struct db_call *call)
{
	struct db_session *session = call->session;
	int64_t wait_ms = WAIT_MS;
	bool given;
	enum db_command command;
	struct db_stops *stops;
	json_t *names;
	struct db_registers *registers = session->control->setup.registers;
	const struct db_args none = { 0 };

	if (!db_act_is_allowed(session) || !db_call_texts(call, "drives", &names) ||
	    !db_call_optional_number(call, "wait_ms", 0, WAIT_MS_MAX, &wait_ms, &given))
		return;
	if (json_array_size(names) > NAMES_MAX) {
		db_session_fail_parameter(session, "drives");
		return;
	}
	command = take_command(call);
	if (command == DB_CMD_NONE)
		return;
	stops = list_parts(registers, names);
	if (!stops) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	session->job = stops;
	session->wait = DB_WAITS_FOR_STOPS;
	session->due = db_control_now(session->control) + wait_ms * DB_NS_PER_MS;
	stops->left = stops->count;
	db_named_gather(registers, true);
	for (size_t i = 0; i < stops->count; i++) {
		struct part *part = &stops->parts[i];
		struct db_write_answer answer = { .later = false };
		struct db_write_token token;
		uint32_t entry;

		if (part->drive != NO_DRIVE) {
			token = db_act_next_token(session);
			part->sequence = token.sequence;
			answer = db_named_run(registers, &session->client, part->drive, command,
			                      &none, 0, token, &entry);
		}
		if (!answer.later)
			end_part(stops, part, answer.result);
	}
	db_named_gather(registers, false);
	if (session->oneway)
		/* Nobody waits for their end. gcc's analyzer: the job is the session's, which frees
		 * it. */
		db_session_reply(session, NULL, false);
	else
		report(session);
}

void db_stops_ended(struct db_session *session, uint32_t sequence, enum db_result result)
{
	struct db_stops *stops = session->job;

	for (size_t i = 0; i < stops->count; i++) {
		struct part *part = &stops->parts[i];

		if (part->ended || part->drive == NO_DRIVE || part->sequence != sequence)
			continue;
		end_part(stops, part, result);
		report(session);
		return;
	}
}

void db_stops_leave(struct db_session *session)
{
	struct db_stops *stops = session->job;

	if (session->wait != DB_WAITS_FOR_STOPS) {
		db_session_reply(session,
		                 json_pack("{s:s}", "result", db_result_name(DB_RESULT_PENDING)),
		                 false);
		return;
	}
	for (size_t i = 0; i < stops->count; i++) {
		if (!stops->parts[i].ended)
			end_part(stops, &stops->parts[i], DB_RESULT_PENDING);
	}
	report(session);
}
