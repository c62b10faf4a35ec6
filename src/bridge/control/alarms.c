/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/call.h"
#include "control/values.h"
#include "drivebridge/clock.h"
#include "drivebridge/health.h"
#include "drivebridge/trouble.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Interval at which changes are checked. */
#define INTERVAL (100 * DB_NS_PER_MS)
/* More would keep Modbus waiting. */
#define AT_ONCE 64
/* Bytes of what somebody says who acknowledges. */
#define COMMENT_MAX 160
#define NUMBER_MAX INT64_C(9007199254740992)

struct wait {
	uint64_t after; /* the change that the client has seen last */
};

static json_t *describe(const struct db_alarm *alarm)
{
	bool of_configuration = alarm->kind == DB_ALARM_CONFIGURATION;
	enum db_trouble_need need = of_configuration ?
	                                    DB_NEED_ACT :
	                                    db_trouble_need((enum db_trouble_cause)alarm->cause);
	const char *cause = of_configuration ? db_troubles_of_configuration(
						       (enum db_configuration_state)alarm->cause) :
	                                       db_trouble_name(alarm->cause);

	return json_pack(
		"{s:I, s:I, s:s, s:o, s:s, s:s, s:o, s:b, s:I, s:I, s:I, s:i, s:I, s:o}", "id",
		(json_int_t)alarm->id, "change", (json_int_t)alarm->change, "kind",
		db_alarm_kind_name((enum db_alarm_kind)alarm->kind), "name",
		db_values_text(alarm->name), "cause", cause, "need", db_trouble_need_name(need),
		"detail", db_values_text(alarm->detail), "present", alarm->gone == 0, "since_us",
		(json_int_t)alarm->since, "came_us", (json_int_t)alarm->came, "gone_us",
		(json_int_t)alarm->gone, "times", (int)alarm->times, "acknowledged_us",
		(json_int_t)alarm->acknowledged, "acknowledged_by", db_values_text(alarm->by));
}

/* What has changed after wait->after, which is moved on. */
static void send_changes(struct db_session *session, struct wait *wait)
{
	const struct db_alarm *picked[AT_ONCE];
	struct db_health *health = *session->control->setup.health;
	const struct db_alarm_list all = db_health_alarms(health);
	size_t count = 0;
	json_t *alarms = json_array();
	struct db_health_state state;

	/* Those that changed first after this change, in that order. */
	for (size_t i = 0; i < all.count; i++) {
		const struct db_alarm *alarm = &all.alarms[i];
		size_t place = count;

		if (alarm->change <= wait->after)
			continue;
		while (place > 0 && picked[place - 1]->change > alarm->change)
			place--;
		if (place == AT_ONCE)
			continue;
		count += count < AT_ONCE;
		for (size_t k = count - 1; k > place; k--)
			picked[k] = picked[k - 1];
		picked[place] = alarm;
	}

	for (size_t i = 0; i < count; i++) {
		json_array_append_new(alarms, describe(picked[i]));
		wait->after = picked[i]->change;
	}
	db_health_state(health, &state);
	db_session_reply(session,
	                 json_pack("{s:o, s:I, s:b, s:b, s:b, s:s}", "alarms", alarms, "change",
	                           (json_int_t)wait->after, "over", count < AT_ONCE, "on", state.on,
	                           "kept", state.kept, "trouble", state.trouble),
	                 session->more);
}

void db_alarms_call(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct wait wait = { .after = 0 };
	struct wait *job;
	int64_t after = 0;
	bool given;

	if (!db_call_optional_number(call, "after", 0, NUMBER_MAX, &after, &given))
		return;
	wait.after = (uint64_t)after;
	if (!*session->control->setup.health) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	if (!session->more) {
		send_changes(session, &wait);
		return;
	}
	job = malloc(sizeof(*job));
	if (!job) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	*job = wait;
	send_changes(session, job);
	/* gcc's analyzer does not see that a session with a call to begin has no other job. */
	session->job = job;
	session->wait = DB_WAITS_FOR_ALARMS;
	session->due = db_control_now(session->control) + INTERVAL;
}

void db_alarms_look(struct db_session *session, db_time now)
{
	uint64_t last_change = db_health_alarms(*session->control->setup.health).last_change;
	struct wait *wait = session->job;

	session->due = now + INTERVAL;
	/* A slow reader gets what has changed until it reads. */
	if (!session->out && last_change > wait->after)
		send_changes(session, wait);
}

/* --- acknowledging ---------------------------------------------------------------------------- */

static void record(struct db_session *session, const struct db_alarm *alarm, const char *comment)
{
	bool of_bus = alarm->kind == DB_ALARM_BUS;
	bool of_drive = alarm->kind == DB_ALARM_DRIVE;
	char text[64 + COMMENT_MAX];

	snprintf(text, sizeof(text), "alarm %llu: %s%s%s", (unsigned long long)alarm->id,
	         of_bus || of_drive ?
	                 db_trouble_name(alarm->cause) :
	                 db_troubles_of_configuration((enum db_configuration_state)alarm->cause),
	         comment[0] ? ": " : "", comment);
	db_session_record(session, &(struct db_audit_entry){
					   .kind = DB_AUDIT_ALARM,
					   .what = "acknowledged",
					   .drive = of_drive ? alarm->name : NULL,
					   .bus = of_bus ? alarm->name : NULL,
					   .text = text,
					   .result = DB_RESULT_OK,
				   });
}

void db_alarms_acknowledge_call(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_health *health = *session->control->setup.health;
	const struct db_alarm *alarm;
	const char *comment = "";
	char by[DB_CLIENT_TEXT_MAX];
	const char *drive = "";
	bool fresh = false;
	int64_t id;

	if (!db_session_require_act(session) || !db_call_number(call, "id", 1, NUMBER_MAX, &id) ||
	    !db_call_optional_text(call, "drive", &drive) ||
	    !db_call_optional_text(call, "comment", &comment))
		return;
	if (strlen(comment) > COMMENT_MAX) {
		db_session_fail_parameter(session, "comment");
		return;
	}
	if (!health) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	db_session_text(session, by);
	alarm = db_health_acknowledge(health, (uint64_t)id, drive, by, db_clock_wall_us(), &fresh);
	if (!alarm) {
		db_session_fail(session, "io.drivebridge.Control.NoSuchAlarm",
		                json_pack("{s:I}", "id", (json_int_t)id));
		return;
	}
	if (fresh)
		record(session, alarm, comment);
	db_session_reply(session, json_pack("{s:o}", "alarm", describe(alarm)), false);
}
