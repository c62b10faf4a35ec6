/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/alarms.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* As of the service's events: what somebody has to do at once is an error there, what somebody has
 * to look at a warning. */
#define SEVERITY_ACT 900
#define SEVERITY_LOOK 600

/* --- taking ----------------------------------------------------------------------------------- */

void db_opcua_alarms_begin(struct db_opcua_alarms *alarms)
{
	alarms->complete = false;
	for (struct db_opcua_alarm *alarm = alarms->list; alarm; alarm = alarm->next)
		alarm->listed = false;
}

/* Names of drives have no slash, and an id without a name has no part for it. NULL without
 * memory. */
static struct db_opcua_alarm *find_or_add(struct db_opcua_alarms *alarms, const json_t *told)
{
	const char *kind = db_words_text(told, "kind");
	const char *name = db_words_text(told, "name");
	struct db_opcua_alarm **end = &alarms->list;
	struct db_opcua_alarm *alarm;
	char id[sizeof(alarm->id)];

	snprintf(id, sizeof(id), DB_OPCUA_ALARMS ".%.15s%s%.63s.%.31s", kind, name[0] ? "." : "",
	         name, db_words_text(told, "cause"));
	while (*end && strcmp((*end)->id, id) != 0)
		end = &(*end)->next;
	alarm = *end;
	if (alarm)
		return alarm;
	alarm = calloc(1, sizeof(*alarm));
	if (!alarm)
		return NULL;
	memcpy(alarm->id, id, sizeof(id));
	alarm->cause = strrchr(alarm->id, '.') + 1;
	snprintf(alarm->kind, sizeof(alarm->kind), "%s", kind);
	snprintf(alarm->name, sizeof(alarm->name), "%s", name);
	/* The list has it, which gcc's analyzer does not see. */
	*end = alarm;
	return alarm;
}

/* True if that is news. */
static bool take_one(struct db_opcua_alarm *alarm, const json_t *told, int64_t us)
{
	int64_t number = db_words_number(told, "id");
	int64_t change = db_words_number(told, "change");
	bool another = number != alarm->number;
	int64_t came_us = db_words_number(told, "came_us");
	int64_t gone_us = db_words_number(told, "gone_us");
	const char *detail = db_words_text(told, "detail");
	bool act = strcmp(db_words_text(told, "need"), "look") != 0;
	unsigned severity = act ? SEVERITY_ACT : SEVERITY_LOOK;
	char cause[32];

	alarm->listed = true;
	/* An older alarm about the same. */
	if (number < alarm->number || (!another && change == alarm->change))
		return false;
	if (another || (gone_us == 0 && came_us != alarm->active_us)) {
		alarm->came = change;
		alarm->comment[0] = '\0';
	}
	alarm->number = number;
	alarm->change = change;
	alarm->present = json_is_true(json_object_get(told, "present"));
	alarm->acknowledged = db_words_number(told, "acknowledged_us") != 0;
	alarm->active_us = alarm->present ? came_us : gone_us;
	alarm->acknowledged_us = db_words_number(told, "acknowledged_us");
	alarm->received_us = us;
	snprintf(alarm->by, sizeof(alarm->by), "%s", db_words_text(told, "acknowledged_by"));
	/* "no_answer" is "no answer". */
	snprintf(cause, sizeof(cause), "%s", alarm->cause);
	for (char *at = cause; *at; at++)
		*at = *at == '_' ? ' ' : *at;
	snprintf(alarm->detail, sizeof(alarm->detail), "%s", detail);
	snprintf(alarm->text, sizeof(alarm->text), "%s: %s%s%s",
	         alarm->name[0] ? alarm->name : alarm->kind, cause, detail[0] ? ": " : "",
	         alarm->detail);
	if (severity != alarm->severity) {
		alarm->severity_before = alarm->severity ? alarm->severity : severity;
		alarm->severity = severity;
		alarm->severity_us = us;
	}
	return true;
}

void db_opcua_alarms_take(struct db_opcua_alarms *alarms, const json_t *answer, int64_t us,
                          db_opcua_alarm_fn *changed, void *context)
{
	size_t i;
	const json_t *told;

	/* The first list tells what there was before this program: only what still concerns
	 * somebody is news. */
	json_array_foreach(json_object_get(answer, "alarms"), i, told)
	{
		struct db_opcua_alarm *alarm = find_or_add(alarms, told);
		bool known = alarm && alarm->change != 0;

		if (alarm && take_one(alarm, told, us) &&
		    (known || alarms->complete || db_opcua_alarm_is_retained(alarm)))
			changed(context, alarm);
	}
	if (alarms->complete || !json_is_true(json_object_get(answer, "over")))
		return;
	alarms->complete = true;
	/* What the service has forgotten, as one that began without its files, concerns nobody any
	 * more. */
	for (struct db_opcua_alarm *alarm = alarms->list; alarm; alarm = alarm->next) {
		bool was = db_opcua_alarm_is_retained(alarm);

		if (alarm->listed)
			continue;
		alarm->number = 0;
		alarm->present = false;
		alarm->acknowledged = true;
		alarm->change++;
		alarm->active_us = us;
		alarm->received_us = us;
		if (was)
			changed(context, alarm);
	}
}

void db_opcua_alarms_free(struct db_opcua_alarms *alarms)
{
	while (alarms->list) {
		struct db_opcua_alarm *alarm = alarms->list;

		alarms->list = alarm->next;
		free(alarm);
	}
}

/* --- looking ---------------------------------------------------------------------------------- */

bool db_opcua_alarm_is_retained(const struct db_opcua_alarm *alarm)
{
	return alarm->change != 0 && (alarm->present || !alarm->acknowledged);
}

void db_opcua_alarm_event_id(const struct db_opcua_alarms *alarms,
                             const struct db_opcua_alarm *alarm, uint8_t id[DB_OPCUA_EVENT_ID_SIZE])
{
	memcpy(id, alarms->salt, sizeof(alarms->salt));
	memcpy(id + 8, &alarm->number, 8);
	memcpy(id + 16, &alarm->change, 8);
}

bool db_opcua_alarm_has_event(const struct db_opcua_alarms *alarms,
                              const struct db_opcua_alarm *alarm, const uint8_t *id, size_t size)
{
	int64_t change;

	if (size != DB_OPCUA_EVENT_ID_SIZE || memcmp(id, alarms->salt, sizeof(alarms->salt)) != 0 ||
	    memcmp(id + 8, &alarm->number, 8) != 0)
		return false;
	memcpy(&change, id + 16, 8);
	return change >= alarm->came && change <= alarm->change;
}

/* --- members ---------------------------------------------------------------------------------- */

#define MEMBER(name)                         \
	{                                    \
		name, name, DB_OPCUA_MEMBERS \
	}
#define PART(above_name, name, above)            \
	{                                        \
		above_name "." name, name, above \
	}

const struct db_opcua_member_row db_opcua_members[DB_OPCUA_MEMBERS] = {
	[DB_OPCUA_MEMBER_EVENT_ID] = MEMBER("EventId"),
	[DB_OPCUA_MEMBER_EVENT_TYPE] = MEMBER("EventType"),
	[DB_OPCUA_MEMBER_SOURCE_NODE] = MEMBER("SourceNode"),
	[DB_OPCUA_MEMBER_SOURCE_NAME] = MEMBER("SourceName"),
	[DB_OPCUA_MEMBER_TIME] = MEMBER("Time"),
	[DB_OPCUA_MEMBER_RECEIVE_TIME] = MEMBER("ReceiveTime"),
	[DB_OPCUA_MEMBER_MESSAGE] = MEMBER("Message"),
	[DB_OPCUA_MEMBER_SEVERITY] = MEMBER("Severity"),
	[DB_OPCUA_MEMBER_CLASS_ID] = MEMBER("ConditionClassId"),
	[DB_OPCUA_MEMBER_CLASS_NAME] = MEMBER("ConditionClassName"),
	[DB_OPCUA_MEMBER_NAME] = MEMBER("ConditionName"),
	[DB_OPCUA_MEMBER_BRANCH] = MEMBER("BranchId"),
	[DB_OPCUA_MEMBER_RETAIN] = MEMBER("Retain"),
	[DB_OPCUA_MEMBER_USER] = MEMBER("ClientUserId"),
	[DB_OPCUA_MEMBER_INPUT] = MEMBER("InputNode"),
	[DB_OPCUA_MEMBER_SUPPRESSED] = MEMBER("SuppressedOrShelved"),
	[DB_OPCUA_MEMBER_ENABLED] = MEMBER("EnabledState"),
	[DB_OPCUA_MEMBER_QUALITY] = MEMBER("Quality"),
	[DB_OPCUA_MEMBER_LAST_SEVERITY] = MEMBER("LastSeverity"),
	[DB_OPCUA_MEMBER_COMMENT] = MEMBER("Comment"),
	[DB_OPCUA_MEMBER_ACKED] = MEMBER("AckedState"),
	[DB_OPCUA_MEMBER_ACTIVE] = MEMBER("ActiveState"),
	[DB_OPCUA_MEMBER_ENABLED_ID] = PART("EnabledState", "Id", DB_OPCUA_MEMBER_ENABLED),
	[DB_OPCUA_MEMBER_QUALITY_TIME] = PART("Quality", "SourceTimestamp",
	                                      DB_OPCUA_MEMBER_QUALITY),
	[DB_OPCUA_MEMBER_LAST_SEVERITY_TIME] = PART("LastSeverity", "SourceTimestamp",
	                                            DB_OPCUA_MEMBER_LAST_SEVERITY),
	[DB_OPCUA_MEMBER_COMMENT_TIME] = PART("Comment", "SourceTimestamp",
	                                      DB_OPCUA_MEMBER_COMMENT),
	[DB_OPCUA_MEMBER_ACKED_ID] = PART("AckedState", "Id", DB_OPCUA_MEMBER_ACKED),
	[DB_OPCUA_MEMBER_ACKED_TIME] = PART("AckedState", "TransitionTime", DB_OPCUA_MEMBER_ACKED),
	[DB_OPCUA_MEMBER_ACTIVE_ID] = PART("ActiveState", "Id", DB_OPCUA_MEMBER_ACTIVE),
	[DB_OPCUA_MEMBER_ACTIVE_TIME] = PART("ActiveState", "TransitionTime",
	                                     DB_OPCUA_MEMBER_ACTIVE),
};

static bool find_member(const char *path, size_t length, enum db_opcua_member *member)
{
	for (size_t i = 0; i < DB_OPCUA_MEMBERS; i++) {
		if (strlen(db_opcua_members[i].path) == length &&
		    memcmp(path, db_opcua_members[i].path, length) == 0) {
			*member = (enum db_opcua_member)i;
			return true;
		}
	}
	return false;
}

struct db_opcua_alarm *db_opcua_alarms_find(const struct db_opcua_alarms *alarms, const char *id,
                                            size_t length, enum db_opcua_member *member)
{
	/* A drive's name may have dots: what follows the id of one condition may be a part of
	 * another one's. */
	for (struct db_opcua_alarm *alarm = alarms->list; alarm; alarm = alarm->next) {
		size_t own = strlen(alarm->id);

		if (length < own || memcmp(id, alarm->id, own) != 0)
			continue;
		*member = DB_OPCUA_MEMBERS;
		if (length == own ||
		    (id[own] == '.' && find_member(id + own + 1, length - own - 1, member)))
			return alarm;
	}
	return NULL;
}
