/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/token.h"

#define TOO_OLD "io.drivebridge.Control.TooOld"
#define NOT_HELD "io.drivebridge.Control.NotHeld"
#define STOPPED_SINCE "io.drivebridge.Control.StoppedSince"

json_t *db_held_token(const struct db_control_socket *control)
{
	char text[DB_TOKEN_MAX];

	db_token_write(text, control->run, db_control_clock());
	return json_string(text);
}

void db_held_clock(const struct db_call *call)
{
	db_session_reply(call->session,
	                 json_pack("{s:o}", "token", db_held_token(call->session->control)), false);
}

/* Without a token no age is stated, and none is checked. *age: see db_token_age_ms(). */
static bool is_young(const struct db_call *call, int64_t *age)
{
	const char *token = json_string_value(json_object_get(call->parameters, "token"));

	*age = 0;
	if (token)
		*age = db_token_age_ms(token, call->session->control->run, db_control_clock());
	return *age != DB_TOKEN_UNKNOWN && *age <= DB_TOKEN_FRESH_MS;
}

bool db_held_is_young(const struct db_call *call)
{
	const char *token = NULL;
	int64_t age;

	if (!db_call_optional_text(call, "token", &token))
		return false;
	if (is_young(call, &age))
		return true;
	db_session_fail(call->session, TOO_OLD,
	                json_pack("{s:o}", "age_ms",
	                          age == DB_TOKEN_UNKNOWN ? json_null() : json_integer(age)));
	return false;
}

bool db_held_is_unstopped(const struct db_call *call, uint16_t drive)
{
	const struct db_control_socket *control = call->session->control;
	const char *name = json_string_value(json_object_get(call->parameters, "drive"));
	const char *token = NULL;
	db_time since;
	int64_t age;

	if (!db_call_optional_text(call, "not_stopped_since", &token))
		return false;
	if (!token)
		return true;
	age = db_token_age_ms(token, control->run, db_control_clock());
	if (age == DB_TOKEN_UNKNOWN) {
		db_session_fail(call->session, TOO_OLD, json_pack("{s:n}", "age_ms"));
		return false;
	}
	/* Tokens are of whole milliseconds, rounded down: a stop of the same one counts. */
	since = db_control_now(control) - age * DB_NS_PER_MS;
	if (db_named_stopped(control->setup.registers, drive) < since)
		return true;
	db_session_fail(call->session, STOPPED_SINCE, json_pack("{s:s}", "drive", name));
	return false;
}

bool db_held_span(const struct db_call *call, const struct db_command_row *row, uint32_t *hold_ms)
{
	struct db_session *session = call->session;
	const char *token = NULL;
	int64_t span = 0;
	bool given;

	*hold_ms = 0;
	/* A stop is always a stop, whatever else is in the call. */
	if (db_command_is_stop(row->code))
		return true;
	if (!db_call_optional_number(call, "hold_ms", DB_HOLD_MIN_MS, DB_HOLD_MAX_MS, &span,
	                             &given) ||
	    !db_call_optional_text(call, "token", &token))
		return false;
	*hold_ms = (uint32_t)span;
	if (!given)
		return true;
	if (!db_command_may_move(row->code))
		db_session_fail_value(session, "hold_ms", "the command starts no motion");
	else if (!token)
		db_session_fail_value(session, "token", "it is missing");
	else if (session->ended)
		/* Its beats cannot arrive: a motion that would be stopped at once is not begun. */
		db_session_fail_result(session, DB_RESULT_CANCELLED, "the connection has ended");
	else
		return true;
	return false;
}

/* False: there is no such drive, or this session does not hold it. */
static bool beat(const struct db_call *call)
{
	struct db_registers *registers = call->session->control->setup.registers;
	const char *name = json_string_value(json_object_get(call->parameters, "drive"));
	struct db_named_drive drive;

	return name && db_named_drive_find(registers, name, &drive) &&
	       db_named_beat(registers, &call->session->client, drive.number);
}

void db_held_beat(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_named_drive drive;
	const char *name;

	if (!db_session_require_act(session) || !db_call_drive(call, false, &drive, &name) ||
	    !db_held_is_young(call))
		return;
	if (beat(call))
		db_session_reply(session, NULL, false);
	else
		db_session_fail(session, NOT_HELD, json_pack("{s:s}", "drive", name));
}

void db_held_beat_silently(const struct db_call *call)
{
	int64_t age;

	if (call->session->client.may_write && is_young(call, &age))
		(void)beat(call);
}
