/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/call.h"
#include "drivebridge/audit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The trail's own thread reads a page; how often it is looked for. */
#define LOOK_EVERY (2 * DB_NS_PER_MS)
/* Since 1970, in microseconds: more than any time. */
#define TIME_MAX INT64_C(9007199254740992)

/* --- reading ---------------------------------------------------------------------------------- */

/* A call while its page is read. */
struct wait {
	struct db_audit_query query;
	bool asked;
};

static bool take_text(const struct db_call *call, const char *name, char *to, size_t size)
{
	const char *text = "";

	if (!db_call_optional_text(call, name, &text))
		return false;
	if (strlen(text) >= size) {
		db_session_fail_parameter(call->session, name);
		return false;
	}
	strcpy(to, text);
	return true;
}

void db_audit_call(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_audit *audit = *session->control->setup.audit;
	struct db_audit_query query = { .from = 0 };
	struct wait *wait;
	int64_t from = 0;
	int64_t since_us = 0;
	bool given;

	if (!db_session_require_act(session) ||
	    !db_call_optional_number(call, "from", 0, TIME_MAX, &from, &given) ||
	    !db_call_optional_number(call, "since_us", 0, TIME_MAX, &since_us, &given) ||
	    !db_call_optional_flag(call, "refused", &query.refused) ||
	    !db_call_optional_flag(call, "verify", &query.verify) ||
	    !take_text(call, "drive", query.drive, sizeof(query.drive)) ||
	    !take_text(call, "who", query.who, sizeof(query.who)))
		return;
	wait = audit ? calloc(1, sizeof(*wait)) : NULL;
	if (!wait) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	query.from = (uint64_t)from;
	query.since_us = (uint64_t)since_us;
	wait->query = query;
	wait->asked = db_audit_ask(audit, session->client.id, &query);
	/* gcc's analyzer does not see that a session with a call to begin has no other job. */
	session->job = wait;
	session->wait = DB_WAITS_FOR_AUDIT;
	session->due = db_control_now(session->control) + LOOK_EVERY;
}

/* The records are text already: a page has hundreds of them. */
static void reply(struct db_session *session, const struct db_audit_page *page)
{
	struct db_audit_state state;
	json_t *broken = json_array();
	json_t *trail;
	json_t *rest;
	char *text;
	char *all = NULL;
	int length = -1;

	for (size_t i = 0; i < page->broken_count; i++)
		json_array_append_new(broken, json_pack("{s:I, s:s, s:I, s:s}", "number",
		                                        (json_int_t)page->broken[i].number, "file",
		                                        page->broken[i].segment, "line",
		                                        (json_int_t)page->broken[i].line, "why",
		                                        page->broken[i].why));
	db_audit_state(*session->control->setup.audit, &state);
	trail = json_pack("{s:b, s:b, s:I, s:I, s:I, s:I, s:s}", "on", state.on, "kept", state.kept,
	                  "newest", (json_int_t)state.newest, "bytes", (json_int_t)state.bytes,
	                  "most_bytes", (json_int_t)state.mib * 1024 * 1024, "lost",
	                  (json_int_t)state.lost, "trouble", state.trouble);
	rest = json_pack("{s:I, s:b, s:I, s:o, s:I, s:o}", "next", (json_int_t)page->next, "over",
	                 page->over, "checked", (json_int_t)page->checked, "broken", broken,
	                 "more_broken", (json_int_t)page->more_broken, "trail", trail);
	text = rest ? json_dumps(rest, JSON_COMPACT) : NULL;
	json_decref(rest);
	if (text)
		length = asprintf(&all, "{\"parameters\":{\"records\":[%.*s],%s}",
		                  (int)page->length, page->records ? page->records : "", text + 1);
	free(text);
	if (length < 0) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	/* With the zero byte that ends a message. */
	db_session_append(session, all, (size_t)length + 1, true);
	free(all);
}

void db_audit_look(struct db_session *session, db_time now)
{
	struct wait *wait = session->job;
	struct db_audit *audit = *session->control->setup.audit;
	struct db_audit_page page;

	session->due = now + LOOK_EVERY;
	if (!wait->asked) {
		wait->asked = db_audit_ask(audit, session->client.id, &wait->query);
		return;
	}
	if (!db_audit_take(audit, session->client.id, &page))
		return;
	reply(session, &page);
	free(page.records);
}

/* --- what tools tell -------------------------------------------------------------------------- */

/* What a user is, or did, at a tool that has users of its own. */
void db_audit_note(const struct db_call *call)
{
	static const struct {
		const char *name;
		enum db_audit_kind kind;
	} kinds[] = { { "login", DB_AUDIT_LOGIN },
		      { "users", DB_AUDIT_USERS },
		      { "denied", DB_AUDIT_DENIED } };
	struct db_session *session = call->session;
	char user[DB_CLIENT_USER_MAX];
	char from[DB_AUDIT_FROM_MAX];
	char drive[64];
	char text[256];
	char what[32];
	const char *kind;
	bool refused = false;

	if (!db_session_require_act(session) || !db_call_text(call, "kind", &kind) ||
	    !take_text(call, "what", what, sizeof(what)) ||
	    !take_text(call, "user", user, sizeof(user)) ||
	    !take_text(call, "from", from, sizeof(from)) ||
	    !take_text(call, "text", text, sizeof(text)) ||
	    !take_text(call, "drive", drive, sizeof(drive)) ||
	    !db_call_optional_flag(call, "refused", &refused))
		return;
	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++) {
		if (strcmp(kind, kinds[i].name) != 0)
			continue;
		db_session_record(session,
		                  &(struct db_audit_entry){
					  .kind = kinds[i].kind,
					  .what = what,
					  .user = user,
					  .from = from,
					  .drive = drive,
					  .text = text,
					  .result = refused ? DB_RESULT_REFUSED : DB_RESULT_OK,
				  });
		db_session_reply(session, NULL, false);
		return;
	}
	db_session_fail_parameter(session, "kind");
}
