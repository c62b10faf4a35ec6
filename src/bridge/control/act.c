/* SPDX-License-Identifier: Apache-2.0 */
#include "control/act.h"

#include "control/control_private.h"
#include "control/once.h"
#include "control/values.h"
#include "drivebridge/command_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Interval at which the end of a motion is checked. */
#define LOOK_INTERVAL (20 * DB_NS_PER_MS)

const char *db_act_reason_of(enum db_result result)
{
	switch (result) {
	case DB_RESULT_REFUSED:
		return "the drive refuses it";
	case DB_RESULT_OUT_OF_RANGE:
		return "a value is outside of the drive's range, or it takes this one only "
		       "together with another";
	case DB_RESULT_TIMEOUT:
		return "the drive does not answer; it was not carried out";
	case DB_RESULT_INDETERMINATE:
		return "the end is not known; look at the drive before you repeat it";
	case DB_RESULT_CANCELLED:
		return "something else ended it, such as a stop, or its drive was taken out";
	case DB_RESULT_LIMIT:
		return "it is outside of the limits of the configuration; see result_limit";
	case DB_RESULT_LATCHED:
		return "the watchdog has stopped the drive; clear_fault ends that";
	case DB_RESULT_UNSUPPORTED:
		return "this drive has no such thing";
	case DB_RESULT_BUS_DOWN:
		return "the bus is down";
	case DB_RESULT_OFFLINE:
		return "the drive is offline";
	case DB_RESULT_FAILED:
		return "the drive tried and failed, or is not where it should be";
	case DB_RESULT_RATE_LIMITED:
		return "it is too soon after the last one";
	case DB_RESULT_NOT_IN_CONTROL:
		return "another client has control of the drive";
	case DB_RESULT_PENDING:
		return "the drive has not confirmed it yet; it goes on";
	case DB_RESULT_RUNS_ON:
		return "the drive does not slow down; it is told on";
	case DB_RESULT_LINE_MOVES:
		return "it would keep the line from a stop for long, and a drive of the line "
		       "moves; it was not sent";
	default:
		return db_result_name(result);
	}
}

static json_t *describe_result(const struct db_session *session, enum db_result result)
{
	json_t *words = json_pack("{s:s}", "result", db_result_name(result));

	if (words && session->repeated)
		json_object_set_new(words, "repeated", json_true());
	return words;
}

/* Final reply. */
static void answer(struct db_session *session, enum db_result result)
{
	/* PENDING: it was submitted, and there are more waiters than can be notified. */
	if (db_result_is_success(result) || result == DB_RESULT_PENDING)
		db_session_reply(session, describe_result(session, result), false);
	else
		db_session_fail_result(session, result, db_act_reason_of(result));
}

/* Final reply to a call that the session itself has begun. `over`: no motion of it continues. */
static void finish(struct db_session *session, enum db_result result, bool over)
{
	db_once_end(session, result, over);
	answer(session, result);
}

/* A session's first command is logged: from then on it counts as commanding drives. */
bool db_act_is_allowed(struct db_session *session)
{
	struct db_control_socket *control = session->control;
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .client = text };

	if (!db_session_require_act(session))
		return false;
	if (!session->acted) {
		db_session_text(session, text);
		db_log(&control->log, db_control_now(control), DB_EVENT_CLIENT_CONNECTED, &about,
		       "connected (session %u, may command)", (unsigned)session->client.port);
	}
	session->acted = true;
	return true;
}

/* Earlier calls keep their user. */
void db_act_introduce(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_control_socket *control = session->control;
	const struct db_actor *before = db_actors_find(&control->actors, session->actor);
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .client = text };
	const char *user;
	const char *from = "";
	bool good;

	session->introduced = true;
	if (!db_session_require_act(session) || !db_call_text(call, "user", &user) ||
	    !db_call_optional_text(call, "from", &from))
		return;
	good = user[0] == '\0' || db_actors_name_is_good(user);
	/* Calls already sent after this one must not run under a wrong name. */
	if (!good)
		user = "";
	/* A different user is a different client: it does not inherit control of drives. */
	if (before && strcmp(before->named, user) != 0) {
		db_registers_backend.restricted(control->setup.registers, &session->client);
		db_session_text(session, text);
		if (session->acted)
			db_log(&control->log, db_control_now(control), DB_EVENT_CLIENT_GONE, &about,
			       "disconnected (session %u now acts for another user)",
			       (unsigned)session->client.port);
		session->acted = false;
		db_session_set_actor(session, before->user, before->process_user, user);
	}
	snprintf(session->from, sizeof(session->from), "%s", good ? from : "");
	if (good)
		db_session_reply(session, NULL, false);
	else
		db_session_fail_value(session, "user",
		                      "a name has 1 to 32 bytes of UTF-8 that can be seen, and no "
		                      "space first or last");
}

struct db_write_token db_act_next_token(struct db_session *session)
{
	return (struct db_write_token){ .client = session->client.id,
		                        .sequence = ++session->sequence };
}

/* --- Write ------------------------------------------------------------------------------------ */

/* One register to be written, with all data that must survive a reload. */
struct item {
	enum db_table table;
	uint16_t address;
	uint16_t registers;
	uint16_t part;
	bool commands; /* it executes a command whose arguments are in neighbouring registers */
	uint16_t words[DB_NAMED_WORDS];
	char name[DB_ROW_NAME_MAX];
};

struct db_write_plan {
	uint16_t drive;
	bool moves;    /* it starts a motion, or keeps one going */
	bool standing; /* nothing is written while the drive moves */
	bool unproven; /* a part that the drive accepted was unproven, and none failed */
	size_t count;
	size_t next;
	struct item items[DB_SETTINGS_MAX];
};

static int by_place(const void *a, const void *b)
{
	const struct item *left = a;
	const struct item *right = b;

	if (left->table != right->table)
		return left->table == DB_TABLE_HOLDING ? -1 : 1;
	return (left->address > right->address) - (left->address < right->address);
}

static bool are_of_one_part(const struct item *one, const struct item *other)
{
	return one->table == other->table && one->part == other->part;
}

/* The end of the adjacent registers that belong together, from this one on. */
static size_t find_end(const struct db_write_plan *plan, size_t from)
{
	const struct item *items = plan->items;
	size_t end = from + 1;

	while (end < plan->count && are_of_one_part(&items[end], &items[end - 1]) &&
	       items[end].address == items[end - 1].address + items[end - 1].registers)
		end++;
	return end;
}

/* Arguments in other places than next to their command are written before it, or it would not have
 * them. A stop has none and waits for nothing. */
static void put_command_last(struct db_write_plan *plan)
{
	struct item moved[DB_SETTINGS_MAX];
	size_t first = 0;
	size_t end = 0;
	size_t last;
	bool found = false;

	while (!found && end < plan->count) {
		first = end;
		end = find_end(plan, first);
		for (size_t i = first; i < end; i++)
			found = found || plan->items[i].commands;
	}
	if (!found)
		return;
	last = end;
	while (last < plan->count && are_of_one_part(&plan->items[first], &plan->items[last]))
		last++;
	memcpy(moved, &plan->items[first], (end - first) * sizeof(moved[0]));
	memmove(&plan->items[first], &plan->items[end], (last - end) * sizeof(moved[0]));
	memcpy(&plan->items[first + last - end], moved, (end - first) * sizeof(moved[0]));
}

/* Continues until a wait is necessary, or all is written. */
static void write_on(struct db_session *session)
{
	struct db_registers *registers = session->control->setup.registers;
	struct db_write_plan *plan = session->job;

	while (plan->next < plan->count) {
		const struct item *first = &plan->items[plan->next];
		uint16_t words[DB_SETTINGS_MAX * DB_NAMED_WORDS] = { 0 };
		size_t beside = find_end(plan, plan->next) - plan->next;
		uint16_t count = 0;
		int exception;

		for (size_t i = 0; i < beside; i++) {
			memcpy(&words[count], first[i].words,
			       first[i].registers * sizeof(words[0]));
			count = (uint16_t)(count + first[i].registers);
		}
		/* The drive may have been set going while the part before was written. */
		if (plan->standing && plan->drive != DB_NAMED_GATEWAY &&
		    !db_named_stands(registers, plan->drive)) {
			if (plan->next > 0)
				db_once_end(session, DB_RESULT_CANCELLED, true);
			else
				db_once_drop(session);
			db_session_fail(
				session, "io.drivebridge.Control.Moving",
				json_pack("{s:s}", "drive", db_named_name(registers, plan->drive)));
			return;
		}
		plan->next += beside;
		session->wait = DB_WAITS_FOR_WRITE;
		exception = db_named_write(registers, &session->client, plan->drive, first->table,
		                           first->address, count, words,
		                           db_act_next_token(session));
		if (exception == DB_WRITE_LATER)
			return;
		if (exception != 0) {
			finish(session,
			       db_named_write_result(registers, &session->client, plan->drive,
			                             (uint8_t)exception),
			       true);
			return;
		}
	}
	finish(session, plan->unproven ? DB_RESULT_UNPROVEN : DB_RESULT_OK, true);
}

/* False when it was answered already. */
static bool plan_item(const struct db_call *call, const struct db_name_list *list,
                      const char *drive, const char *name, const json_t *json,
                      struct db_write_plan *plan)
{
	struct item *item = &plan->items[plan->count];
	const struct db_entry *entry = db_name_list_find(list, name);
	char reason[DB_REASON_MAX];
	double number;

	if (!entry) {
		db_session_fail_register(call->session, drive, name);
		return false;
	}
	if (!(entry->cell.flags & DB_ROW_WRITABLE)) {
		db_session_fail_value(call->session, name, "it can only be read");
		return false;
	}
	if (!db_values_from_json(entry, json, &number, reason)) {
		db_session_fail_value(call->session, name, reason);
		return false;
	}
	*item = (struct item){
		.table = entry->table,
		.address = entry->cell.address,
		.registers = entry->cell.registers,
		.part = entry->cell.part,
	};
	snprintf(item->name, sizeof(item->name), "%s", name);
	item->commands = db_named_commands(plan->drive, entry, number);
	plan->moves = plan->moves || db_named_moves(plan->drive, entry, number);
	if (entry->table == DB_TABLE_COILS)
		item->words[0] = number > 0.0;
	else
		db_named_encode(call->session->control->setup.registers, entry, number,
		                item->words);
	return true;
}

void db_act_write(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_named_drive drive;
	const struct db_name_list *list;
	struct db_write_plan *plan;
	const char *name;
	const char *key;
	json_t *values;
	json_t *value;
	bool standing = false;

	if (!db_act_is_allowed(session) || !db_call_drive(call, true, &drive, &name) ||
	    !db_call_object(call, "values", false, &values) ||
	    !db_call_optional_flag(call, "standing", &standing))
		return;
	if (json_object_size(values) == 0 || json_object_size(values) > DB_SETTINGS_MAX) {
		db_session_fail_parameter(session, "values");
		return;
	}
	list = db_named_registers(session->control->setup.registers, drive.number);
	plan = calloc(1, sizeof(*plan));
	if (!list || !plan) {
		free(plan);
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	plan->drive = drive.number;
	plan->standing = standing;
	/* All values are checked before any is written. */
	json_object_foreach(values, key, value)
	{
		if (!plan_item(call, list, name, key, value, plan)) {
			free(plan);
			return;
		}
		plan->count++;
	}
	if (!db_once_begin(call, name, false)) {
		free(plan);
		return;
	}
	if (plan->moves && !db_held_is_young(call)) {
		db_once_drop(session);
		free(plan);
		return;
	}
	qsort(plan->items, plan->count, sizeof(plan->items[0]), by_place);
	put_command_last(plan);
	session->job = plan;
	write_on(session);
}

/* --- Run -------------------------------------------------------------------------------------- */

static bool has_argument(const struct db_command_row *row, const struct db_entry *entry)
{
	for (size_t i = 0; i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		if (db_named_is_argument(entry, row->args[i]))
			return true;
	}
	return false;
}

/* False when the call was answered already. `list` may be null for a command without arguments. */
static bool take_arguments(const struct db_call *call, const struct db_name_list *list,
                           const struct db_command_row *row, json_t *arguments,
                           struct db_args *args)
{
	const char *name;
	char reason[DB_REASON_MAX];
	json_t *value;

	json_object_foreach(arguments, name, value)
	{
		const struct db_entry *entry = list ? db_name_list_find(list, name) : NULL;
		double number;

		if (!entry || !has_argument(row, entry)) {
			db_session_fail_value(call->session, name,
			                      "the command has no such argument");
			return false;
		}
		if (!db_values_from_json(entry, value, &number, reason)) {
			db_session_fail_value(call->session, name, reason);
			return false;
		}
		db_named_store_argument(entry, number, args);
	}
	/* Nothing must move because of a forgotten name. */
	for (size_t i = 0; i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		enum db_arg arg = row->args[i];
		/* Arguments that a PLC may leave 0 as well: the drive's preset speed, start at
		 * once, no more words of a frame. */
		bool may_be_missing = (arg == DB_ARG_TARGET_VELOCITY &&
		                       row->code != DB_CMD_MOVE_VELOCITY) ||
		                      arg == DB_ARG_PROGRAM_DELAY || arg == DB_ARG_RAW_REQUEST;

		for (size_t r = 0; !may_be_missing && list && r < list->count; r++) {
			const struct db_entry *entry = &list->entries[r];

			if (!db_named_is_argument(entry, arg) ||
			    json_object_get(arguments, entry->name))
				continue;
			snprintf(reason, sizeof(reason), "%s needs it", row->name);
			db_session_fail_value(call->session, entry->name, reason);
			return false;
		}
	}
	return true;
}

static void end_run(struct db_session *session, enum db_result result, db_time now)
{
	bool over = !db_result_is_success(result) ||
	            db_named_outcome(session->control->setup.registers, session->drive,
	                             session->entry) != DB_RESULT_PENDING;

	if (!session->until_end || !db_result_is_success(result)) {
		finish(session, result, over);
		return;
	}
	db_once_end(session, result, over);
	session->wait = DB_WAITS_FOR_MOTION;
	session->due = now;
}

/* As db_once_begin(); a client that waits for the first call is also notified that it was
 * accepted. */
static bool begin_run(const struct db_call *call, const char *drive, bool stops)
{
	struct db_session *session = call->session;

	if (db_once_begin(call, drive, stops))
		return true;
	if (session->wait == DB_WAITS_FOR_FIRST && session->more)
		db_session_reply(session, describe_result(session, DB_RESULT_PENDING), true);
	return false;
}

void db_act_run(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_registers *registers = session->control->setup.registers;
	const struct db_command_row *row;
	const struct db_name_list *list;
	struct db_args args = { 0 };
	struct db_write_answer taken;
	struct db_write_token token;
	struct db_named_drive drive;
	const char *drive_name;
	const char *command;
	json_t *arguments;
	uint32_t hold_ms;

	session->until_end = false;
	if (!db_act_is_allowed(session) || !db_call_drive(call, false, &drive, &drive_name) ||
	    !db_call_text(call, "command", &command) ||
	    !db_call_object(call, "arguments", true, &arguments) ||
	    !db_call_optional_flag(call, "until_end", &session->until_end))
		return;
	row = db_command_find_name(command);
	if (!row || !(drive.commands & DB_COMMAND_BIT(row->code))) {
		db_session_fail(session, "io.drivebridge.Control.NoSuchCommand",
		                json_pack("{s:s, s:s}", "drive", drive_name, "command", command));
		return;
	}
	if (!db_positions_resolve(call, row, &drive))
		return;
	arguments = json_object_get(call->parameters, "arguments");
	/* A stop has no arguments, and is not refused for lack of memory for their names. */
	list = db_command_is_stop(row->code) ? NULL : db_named_registers(registers, drive.number);
	if (!list && !db_command_is_stop(row->code)) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	if (!take_arguments(call, list, row, arguments, &args) ||
	    !db_held_span(call, row, &hold_ms) ||
	    !begin_run(call, drive_name, db_command_is_stop(row->code)))
		return;
	if ((db_command_may_move(row->code) &&
	     !(db_held_is_young(call) && db_held_is_unstopped(call, drive.number))) ||
	    !db_positions_allow(call, row, &drive)) {
		db_once_drop(session);
		return;
	}
	session->drive = drive.number;
	session->wait = DB_WAITS_FOR_RUN;
	token = db_act_next_token(session);
	taken = db_named_run(registers, &session->client, drive.number, row->code, &args, hold_ms,
	                     token, &session->entry);
	db_once_note_begun(session, token, session->entry);
	if (!taken.later)
		end_run(session, taken.result, db_control_now(session->control));
	else if (session->oneway)
		/* Nobody waits for its end: later calls need not wait either. */
		db_session_reply(session, NULL, false);
	else if (session->more)
		db_session_reply(session, describe_result(session, DB_RESULT_PENDING), true);
}

/* --- going on --------------------------------------------------------------------------------- */

void db_act_ended(struct db_session *session, enum db_result result)
{
	if (session->wait == DB_WAITS_FOR_RUN) {
		end_run(session, result, db_control_now(session->control));
	} else if (!db_result_is_success(result)) {
		finish(session, result, true);
	} else {
		struct db_write_plan *plan = session->job;

		plan->unproven |= result == DB_RESULT_UNPROVEN;
		write_on(session);
	}
}

void db_act_look(struct db_session *session, db_time now)
{
	struct db_registers *registers = session->control->setup.registers;
	enum db_result result;
	const struct db_id_call *first;

	if (session->wait == DB_WAITS_FOR_FIRST) {
		/* The earlier instance of the same call. */
		first = db_once_first(session);
		if (!first) {
			answer(session, DB_RESULT_BUSY);
		} else if (first->result == DB_RESULT_PENDING) {
			session->due = now + LOOK_INTERVAL;
		} else if (session->until_end && db_result_is_success(first->result) &&
		           !first->over) {
			session->drive = first->drive;
			session->entry = first->entry;
			session->wait = DB_WAITS_FOR_MOTION;
			session->due = now;
		} else {
			answer(session, first->result);
		}
		return;
	}
	result = db_named_outcome(registers, session->drive, session->entry);
	if (result != DB_RESULT_PENDING) {
		finish(session, result, true);
		return;
	}
	/* A waiting client is alive: a tool that dies ends its session. */
	db_named_hear(registers, &session->client, session->drive);
	session->due = now + LOOK_INTERVAL;
}
