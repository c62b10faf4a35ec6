/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/call.h"
#include "drivebridge/clock.h"
#include "drivebridge/health.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* The thread of the values reads; how often its answer is looked for. */
#define LOOK_EVERY (2 * DB_NS_PER_MS)
/* Since 1970, in microseconds: more than any time. */
#define TIME_MAX INT64_C(9007199254740992)
#define STEP_MAX_S 3600

/* A call while its values are read. */
struct wait {
	struct db_health_query query;
	bool asked;
};

static bool ask(struct db_session *session, const struct db_health_query *query)
{
	return db_health_ask(*session->control->setup.health, session->client.id, query,
	                     db_control_now(session->control), db_clock_wall_us());
}

static void begin(const struct db_call *call, bool rows)
{
	struct db_session *session = call->session;
	struct db_health_query query = { .rows = rows };
	const char *drive = "";
	struct wait *wait;
	int64_t since_us = 0;
	int64_t step_s = 0;
	bool given;

	if ((!rows && !db_call_optional_text(call, "drive", &drive)) ||
	    !db_call_optional_number(call, "since_us", 0, TIME_MAX, &since_us, &given) ||
	    !db_call_optional_number(call, "step_s", 0, STEP_MAX_S, &step_s, &given))
		return;
	if (step_s != 0 && step_s != 60 && step_s != 900 && step_s != STEP_MAX_S) {
		db_session_fail_parameter(session, "step_s");
		return;
	}
	if (strlen(drive) >= sizeof(query.drive)) {
		db_session_fail_drive(session, drive);
		return;
	}
	wait = *session->control->setup.health ? calloc(1, sizeof(*wait)) : NULL;
	if (!wait) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	strcpy(query.drive, drive);
	query.since_us = (uint64_t)since_us;
	query.step_s = (uint32_t)step_s;
	wait->query = query;
	wait->asked = ask(session, &query);
	/* gcc's analyzer does not see that a session with a call to begin has no other job. */
	session->job = wait;
	session->wait = DB_WAITS_FOR_HEALTH;
	session->due = db_control_now(session->control) + LOOK_EVERY;
}

void db_health_call(const struct db_call *call)
{
	begin(call, false);
}

void db_health_rows_call(const struct db_call *call)
{
	begin(call, true);
}

/* The values are text already: there may be more than a thousand of them. */
static void reply(struct db_session *session, const struct db_health_page *page,
                  const char *running)
{
	const struct wait *wait = session->job;
	struct db_health_state state;
	char *rest;
	char *all = NULL;
	int length = -1;

	db_health_state(*session->control->setup.health, &state);
	rest = db_message_text(json_pack("{s:i, s:b, s:b, s:s}", "step_s", (int)page->step_s, "on",
	                                 state.on, "kept", state.kept, "trouble", state.trouble));
	if (rest && wait->query.rows)
		length = asprintf(&all, "{\"parameters\":{%s,%s}",
		                  page->values ? page->values : "\"times\":[],\"rows\":[]",
		                  rest + 1);
	else if (rest)
		length = asprintf(&all, "{\"parameters\":{\"values\":[%s],\"running\":[%s],%s}",
		                  page->values ? page->values : "", running, rest + 1);
	free(rest);
	if (length < 0) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	/* With the zero byte that ends a message. */
	db_session_append(session, all, (size_t)length + 1, true);
	free(all);
}

void db_health_look(struct db_session *session, db_time now)
{
	struct db_health *health = *session->control->setup.health;
	struct wait *wait = session->job;
	struct db_health_page page;
	struct db_named_drive drive;
	char name[DB_HEALTH_NAME_MAX];
	char *running;

	session->due = now + LOOK_EVERY;
	if (!wait->asked) {
		wait->asked = ask(session, &wait->query);
		return;
	}
	if (!db_health_take(health, session->client.id, &page))
		return;
	strcpy(name, wait->query.drive);
	running = db_health_running(health, name, now, db_clock_wall_us());
	/* A drive that is not configured any more may have values. */
	if (!page.known && name[0] != '\0' &&
	    !db_named_drive_find(session->control->setup.registers, name, &drive))
		db_session_fail_drive(session, name);
	else if (!running)
		db_session_fail_result(session, DB_RESULT_BUSY, "");
	else
		reply(session, &page, running);
	free(running);
	free(page.values);
}
