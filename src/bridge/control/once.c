/* SPDX-License-Identifier: Apache-2.0 */
#include "control/once.h"

#include "control/control_private.h"

#include <string.h>

/* *id is null when the call has none; false when the call was answered. */
static bool read_id(const struct db_call *call, const char **id)
{
	const json_t *value = json_object_get(call->parameters, "id");
	size_t length = json_string_length(value);

	*id = NULL;
	if (!value || json_is_null(value))
		return true;
	*id = json_string_value(value);
	if (*id && length >= 1 && length <= DB_ID_MAX && strlen(*id) == length)
		return true;
	db_session_fail_parameter(call->session, "id");
	return false;
}

bool db_once_begin(const struct db_call *call, const char *drive, bool stops)
{
	struct db_session *session = call->session;
	struct db_control_socket *control = session->control;
	db_time now = db_control_now(control);
	const struct db_id_call *first;
	struct db_id_key key;
	int64_t within_ms;
	int64_t sent_us;
	db_time within;
	db_time sent;
	const char *id;
	bool limited;
	bool dated;
	const struct db_actor *actor;

	session->once = 0;
	if (!read_id(call, &id) ||
	    !db_call_optional_number(call, "within_ms", 1, DB_IDS_TIME_MAX / DB_NS_PER_MS,
	                             &within_ms, &limited) ||
	    !db_call_optional_number(call, "sent_us", 0, INT64_MAX / DB_NS_PER_US, &sent_us,
	                             &dated))
		return false;
	/* Both are harmless if late or repeated. */
	if (stops)
		return true;
	within = limited ? within_ms * DB_NS_PER_MS : DB_IDS_TIME_MAX;
	/* It began to wait when its caller sent it, which has the same clock, or when it was read
	 * here. */
	sent = dated ? sent_us * DB_NS_PER_US : session->client.arrived;
	actor = db_actors_find(&session->control->actors, session->actor);
	key = (struct db_id_key){
		.user = actor ? actor->user : UINT32_MAX,
		.named = actor ? actor->named : "",
		.drive = drive,
		.id = id,
	};
	first = id ? db_ids_find(&control->ids, &key) : NULL;
	if (first) {
		session->once = first->number;
		session->repeated = true;
		session->wait = DB_WAITS_FOR_FIRST;
		session->due = now;
		/* Nobody waits for its end, and later calls need not either. */
		if (session->oneway)
			db_session_reply(session, NULL, false);
		return false;
	}
	if (limited && now - sent > within) {
		db_session_fail(
			session, "io.drivebridge.Control.Late",
			json_pack("{s:s}", "reason",
		                  "the service received it too late and does not begin it"));
		return false;
	}
	if (!id)
		return true;
	first = db_ids_add(&control->ids, &key, now + within, now);
	if (first)
		session->once = first->number;
	else
		db_session_fail_result(session, DB_RESULT_BUSY, "");
	return first != NULL;
}

void db_once_drop(struct db_session *session)
{
	db_ids_drop(&session->control->ids, session->once);
	session->once = 0;
}

void db_once_note_begun(struct db_session *session, struct db_write_token token, uint32_t entry)
{
	struct db_id_call *call = db_ids_at(&session->control->ids, session->once);

	if (!call)
		return;
	call->token = token;
	call->drive = session->drive;
	call->entry = entry;
}

void db_once_end(struct db_session *session, enum db_result result, bool over)
{
	struct db_ids *ids = &session->control->ids;
	struct db_id_call *call = db_ids_at(ids, session->once);

	if (!call)
		return;
	if (result == DB_RESULT_BUSY || result == DB_RESULT_NOT_IN_CONTROL) {
		db_ids_drop(ids, session->once);
		return;
	}
	/* If nobody could wait for the end, it is not known. */
	call->result = result == DB_RESULT_PENDING ? DB_RESULT_INDETERMINATE : result;
	call->over = call->over || over;
}

const struct db_id_call *db_once_first(const struct db_session *session)
{
	return db_ids_at(&session->control->ids, session->once);
}

void db_once_abandon(struct db_session *session)
{
	/* Some parts are written, others never will be. The end of a command is still reported by
	 * its token. */
	if (session->wait == DB_WAITS_FOR_WRITE)
		db_once_end(session, DB_RESULT_INDETERMINATE, true);
	session->once = 0;
}
