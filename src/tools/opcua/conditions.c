/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/conditions.h"
#include "opcua/references.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/log.h"

#include <open62541/server.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

/* Conditions that are told again at once. A monitored item keeps 80 events for the next publishing
 * (server.c), and others may come in between. */
#define REFRESH_AT_ONCE 20

/* Longest time until the next ones: a subscription that publishes more rarely may lose some. */
#define REFRESH_PAUSE_MAX (2 * DB_NS_PER_S)

struct db_opcua_conditions {
	struct db_opcua_roster *roster;
	UA_Server *server;
	db_opcua_acknowledge_fn *acknowledge;
	void *context;
	/* What is told again: the next one; NULL: nothing, or the end. */
	struct db_opcua_alarm *next;
	bool refreshing;
	db_time due;
	db_time pause;
};

struct db_opcua_conditions *db_opcua_conditions_new(struct db_opcua_roster *roster,
                                                    db_opcua_acknowledge_fn *acknowledge,
                                                    void *context)
{
	struct db_opcua_conditions *conditions = calloc(1, sizeof(*conditions));
	int64_t now_us = db_client_wall_us();

	if (!conditions)
		return NULL;
	conditions->roster = roster;
	conditions->acknowledge = acknowledge;
	conditions->context = context;
	conditions->due = DB_TIME_NEVER;
	/* The time is another one in each run, too. */
	if (getrandom(roster->alarms.salt, sizeof(roster->alarms.salt), GRND_NONBLOCK) !=
	    sizeof(roster->alarms.salt))
		memcpy(roster->alarms.salt, &now_us, sizeof(roster->alarms.salt));
	return conditions;
}

/* --- members ---------------------------------------------------------------------------------- */

const UA_DataType *db_opcua_condition_type(enum db_opcua_member member)
{
	switch (member) {
	case DB_OPCUA_MEMBER_EVENT_ID:
		return &UA_TYPES[UA_TYPES_BYTESTRING];
	case DB_OPCUA_MEMBER_EVENT_TYPE:
	case DB_OPCUA_MEMBER_SOURCE_NODE:
	case DB_OPCUA_MEMBER_CLASS_ID:
	case DB_OPCUA_MEMBER_BRANCH:
	case DB_OPCUA_MEMBER_INPUT:
		return &UA_TYPES[UA_TYPES_NODEID];
	case DB_OPCUA_MEMBER_SOURCE_NAME:
	case DB_OPCUA_MEMBER_NAME:
	case DB_OPCUA_MEMBER_USER:
		return &UA_TYPES[UA_TYPES_STRING];
	case DB_OPCUA_MEMBER_SEVERITY:
	case DB_OPCUA_MEMBER_LAST_SEVERITY:
		return &UA_TYPES[UA_TYPES_UINT16];
	case DB_OPCUA_MEMBER_RETAIN:
	case DB_OPCUA_MEMBER_SUPPRESSED:
	case DB_OPCUA_MEMBER_ENABLED_ID:
	case DB_OPCUA_MEMBER_ACKED_ID:
	case DB_OPCUA_MEMBER_ACTIVE_ID:
		return &UA_TYPES[UA_TYPES_BOOLEAN];
	case DB_OPCUA_MEMBER_QUALITY:
		return &UA_TYPES[UA_TYPES_STATUSCODE];
	case DB_OPCUA_MEMBER_MESSAGE:
	case DB_OPCUA_MEMBER_CLASS_NAME:
	case DB_OPCUA_MEMBER_ENABLED:
	case DB_OPCUA_MEMBER_COMMENT:
	case DB_OPCUA_MEMBER_ACKED:
	case DB_OPCUA_MEMBER_ACTIVE:
		return &UA_TYPES[UA_TYPES_LOCALIZEDTEXT];
	default:
		return &UA_TYPES[UA_TYPES_DATETIME];
	}
}

/* The node of what the alarm is about; its folder when that is not there any more. */
static struct db_opcua_id source_of(const struct db_opcua_roster *roster,
                                    const struct db_opcua_alarm *alarm)
{
	struct db_opcua_subject subject;
	struct db_opcua_id id;

	if (strcmp(alarm->kind, "drive") == 0) {
		id = db_opcua_id_of(alarm->name, "");
		if (!db_opcua_roster_find(roster, alarm->name, strlen(alarm->name)))
			id = db_opcua_id_of(DB_OPCUA_DRIVES, "");
	} else if (strcmp(alarm->kind, "bus") == 0) {
		id = db_opcua_id_of(DB_OPCUA_BUSES, alarm->name);
		if (!db_opcua_roster_identify(roster, id.text, strlen(id.text), &subject))
			id = db_opcua_id_of(DB_OPCUA_BUSES, "");
	} else {
		id = db_opcua_id_of(DB_OPCUA_GATEWAY, "");
	}
	return id;
}

/* The variable that shows what is wrong; one that the configuration does not show is none. */
static struct db_opcua_id input_of(const struct db_opcua_roster *roster,
                                   const struct db_opcua_alarm *alarm)
{
	struct db_opcua_id source = source_of(roster, alarm);
	const char *part = strcmp(alarm->kind, "drive") == 0 ? "Trouble" :
	                   strcmp(alarm->kind, "bus") == 0   ? "TroubleCause" :
	                                                       "Diagnosis.ConfigurationCause";
	struct db_opcua_id id = db_opcua_id_of(source.text, part);
	struct db_opcua_subject subject;

	if (!db_opcua_roster_identify(roster, id.text, strlen(id.text), &subject))
		id.text[0] = '\0';
	return id;
}

static int64_t latest(const struct db_opcua_alarm *alarm)
{
	return alarm->acknowledged_us > alarm->active_us ? alarm->acknowledged_us :
	                                                   alarm->active_us;
}

/* One value in the form of the library's types. Texts stay the alarm's. */
union plain {
	UA_Boolean flag;
	UA_UInt16 u16;
	UA_StatusCode status;
	UA_DateTime date;
	UA_NodeId node;
	UA_String text;
	UA_LocalizedText words;
};

static bool flag_of(const struct db_opcua_alarm *alarm, enum db_opcua_member member)
{
	switch (member) {
	case DB_OPCUA_MEMBER_RETAIN:
		return db_opcua_alarm_is_retained(alarm);
	case DB_OPCUA_MEMBER_ENABLED_ID:
		return true;
	case DB_OPCUA_MEMBER_ACKED_ID:
		return alarm->acknowledged;
	case DB_OPCUA_MEMBER_ACTIVE_ID:
		return alarm->present;
	default:
		return false;
	}
}

static const char *words_of(const struct db_opcua_alarm *alarm, enum db_opcua_member member)
{
	bool of_drive = strcmp(alarm->kind, "drive") == 0;

	switch (member) {
	case DB_OPCUA_MEMBER_MESSAGE:
		return alarm->text;
	case DB_OPCUA_MEMBER_CLASS_NAME:
		return of_drive ? "ProcessConditionClassType" : "SystemConditionClassType";
	case DB_OPCUA_MEMBER_ENABLED:
		return "Enabled";
	case DB_OPCUA_MEMBER_COMMENT:
		return alarm->comment;
	case DB_OPCUA_MEMBER_ACKED:
		return alarm->acknowledged ? "Acknowledged" : "Unacknowledged";
	case DB_OPCUA_MEMBER_ACTIVE:
		return alarm->present ? "Active" : "Inactive";
	case DB_OPCUA_MEMBER_SOURCE_NAME:
		return alarm->name[0] ? alarm->name : alarm->kind;
	case DB_OPCUA_MEMBER_USER:
		return alarm->by;
	default:
		return alarm->cause;
	}
}

static int64_t time_of(const struct db_opcua_alarm *alarm, enum db_opcua_member member)
{
	switch (member) {
	case DB_OPCUA_MEMBER_RECEIVE_TIME:
		return alarm->received_us;
	case DB_OPCUA_MEMBER_LAST_SEVERITY_TIME:
		return alarm->severity_us;
	case DB_OPCUA_MEMBER_COMMENT_TIME:
	case DB_OPCUA_MEMBER_ACKED_TIME:
		return alarm->acknowledged_us;
	case DB_OPCUA_MEMBER_ACTIVE_TIME:
		return alarm->active_us;
	default:
		return latest(alarm);
	}
}

/* `id` has the text of the node. */
static UA_NodeId node_of(const struct db_opcua_roster *roster, const struct db_opcua_alarm *alarm,
                         enum db_opcua_member member, struct db_opcua_id *id)
{
	switch (member) {
	case DB_OPCUA_MEMBER_EVENT_TYPE:
		return UA_NODEID_NUMERIC(0, UA_NS0ID_DISCRETEALARMTYPE);
	case DB_OPCUA_MEMBER_CLASS_ID:
		return UA_NODEID_NUMERIC(0, strcmp(alarm->kind, "drive") == 0 ?
		                                    UA_NS0ID_PROCESSCONDITIONCLASSTYPE :
		                                    UA_NS0ID_SYSTEMCONDITIONCLASSTYPE);
	case DB_OPCUA_MEMBER_SOURCE_NODE:
		*id = source_of(roster, alarm);
		return db_opcua_node_id(roster, id);
	case DB_OPCUA_MEMBER_INPUT:
		*id = input_of(roster, alarm);
		return id->text[0] ? db_opcua_node_id(roster, id) : UA_NODEID_NULL;
	default:
		return UA_NODEID_NULL; /* the present state is no branch */
	}
}

UA_StatusCode db_opcua_condition_read(const struct db_opcua_roster *roster,
                                      const struct db_opcua_subject *subject, UA_StatusCode quality,
                                      UA_DataValue *value)
{
	const struct db_opcua_alarm *alarm = subject->alarm;
	enum db_opcua_member member = subject->member;
	const UA_DataType *type = db_opcua_condition_type(member);
	uint8_t event[DB_OPCUA_EVENT_ID_SIZE];
	struct db_opcua_id id;
	union plain plain;
	UA_StatusCode status;

	memset(&plain, 0, sizeof(plain));
	if (type == &UA_TYPES[UA_TYPES_BYTESTRING]) {
		db_opcua_alarm_event_id(&roster->alarms, alarm, event);
		plain.text = (UA_String){ .length = sizeof(event), .data = event };
	} else if (type == &UA_TYPES[UA_TYPES_NODEID]) {
		plain.node = node_of(roster, alarm, member, &id);
	} else if (type == &UA_TYPES[UA_TYPES_STRING]) {
		plain.text = db_opcua_string(words_of(alarm, member));
	} else if (type == &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]) {
		plain.words = db_opcua_english(words_of(alarm, member));
	} else if (type == &UA_TYPES[UA_TYPES_UINT16]) {
		plain.u16 = (UA_UInt16)(member == DB_OPCUA_MEMBER_SEVERITY ?
		                                alarm->severity :
		                                alarm->severity_before);
	} else if (type == &UA_TYPES[UA_TYPES_BOOLEAN]) {
		plain.flag = flag_of(alarm, member);
	} else if (type == &UA_TYPES[UA_TYPES_STATUSCODE]) {
		plain.status = quality;
	} else {
		plain.date = db_opcua_date(time_of(alarm, member));
	}
	status = UA_Variant_setScalarCopy(&value->value, &plain, type);
	value->hasValue = status == UA_STATUSCODE_GOOD;
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = db_opcua_date(latest(alarm));
	return status;
}

/* --- telling ---------------------------------------------------------------------------------- */

/* The library writes the source, the id and the time of an event into its node before it reads them
 * (nodes.c drops that): they are the condition's own. */
static void tell(void *context, struct db_opcua_alarm *alarm)
{
	const struct db_opcua_conditions *conditions = context;
	struct db_opcua_id id = db_opcua_id_of(alarm->id, "");
	struct db_opcua_id source = source_of(conditions->roster, alarm);
	UA_StatusCode status = UA_Server_triggerEvent(
		conditions->server, db_opcua_node_id(conditions->roster, &id),
		db_opcua_node_id(conditions->roster, &source), NULL, false);

	if (status != UA_STATUSCODE_GOOD)
		db_client_log(DB_CLIENT_WARNING, "alarm %s cannot be told: %s", alarm->id,
		              UA_StatusCode_name(status));
}

void db_opcua_conditions_take(struct db_opcua_conditions *conditions, const json_t *answer,
                              bool first)
{
	if (first)
		db_opcua_alarms_begin(&conditions->roster->alarms);
	db_opcua_alarms_take(&conditions->roster->alarms, answer, db_client_wall_us(), tell,
	                     conditions);
}

/* --- telling again ---------------------------------------------------------------------------- */

/* The begin or the end of it. */
static UA_StatusCode tell_bound(const struct db_opcua_conditions *conditions, UA_UInt32 type,
                                const char *text)
{
	UA_NodeId server = UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER);
	UA_DateTime now = UA_DateTime_now();
	UA_LocalizedText message = db_opcua_english(text);
	UA_UInt16 severity = 100;
	UA_NodeId event = UA_NODEID_NULL;
	UA_StatusCode status = UA_Server_createEvent(conditions->server, UA_NODEID_NUMERIC(0, type),
	                                             &event);

	if (status != UA_STATUSCODE_GOOD)
		return status;
	status = UA_Server_writeObjectProperty_scalar(conditions->server, event,
	                                              UA_QUALIFIEDNAME(0, (char[]){ "Time" }), &now,
	                                              &UA_TYPES[UA_TYPES_DATETIME]);
	status |= UA_Server_writeObjectProperty_scalar(conditions->server, event,
	                                               UA_QUALIFIEDNAME(0, (char[]){ "Message" }),
	                                               &message, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]);
	status |= UA_Server_writeObjectProperty_scalar(conditions->server, event,
	                                               UA_QUALIFIEDNAME(0, (char[]){ "Severity" }),
	                                               &severity, &UA_TYPES[UA_TYPES_UINT16]);
	if (status == UA_STATUSCODE_GOOD)
		return UA_Server_triggerEvent(conditions->server, event, server, NULL, true);
	(void)UA_Server_deleteNode(conditions->server, event, true);
	return status;
}

/* Some of the retained ones, and after them the end. */
static void tell_some(struct db_opcua_conditions *conditions, db_time now)
{
	unsigned count = 0;

	for (; conditions->next; conditions->next = conditions->next->next) {
		if (!db_opcua_alarm_is_retained(conditions->next))
			continue;
		if (count++ == REFRESH_AT_ONCE) {
			conditions->due = now + conditions->pause;
			return;
		}
		tell(conditions, conditions->next);
	}
	(void)tell_bound(conditions, UA_NS0ID_REFRESHENDEVENTTYPE,
	                 "All alarms that concern somebody have been told");
	conditions->refreshing = false;
	conditions->due = DB_TIME_NEVER;
}

db_time db_opcua_conditions_tend(struct db_opcua_conditions *conditions, db_time now)
{
	if (now >= conditions->due)
		tell_some(conditions, now);
	return conditions->due;
}

/* The subscription of this session, and its interval in milliseconds. The library has no function
 * for that, but a variable. False: the session has no such subscription. */
static bool find_subscription(UA_Server *server, const UA_NodeId *session, UA_UInt32 id,
                              double *interval_ms)
{
	UA_Variant list;
	bool found = false;

	if (UA_Server_readValue(
		    server,
		    UA_NODEID_NUMERIC(
			    0, UA_NS0ID_SERVER_SERVERDIAGNOSTICS_SUBSCRIPTIONDIAGNOSTICSARRAY),
		    &list) != UA_STATUSCODE_GOOD)
		return false;
	if (list.type == &UA_TYPES[UA_TYPES_SUBSCRIPTIONDIAGNOSTICSDATATYPE]) {
		const UA_SubscriptionDiagnosticsDataType *one = list.data;

		for (size_t i = 0; i < list.arrayLength; i++) {
			if (one[i].subscriptionId != id ||
			    !UA_NodeId_equal(&one[i].sessionId, session))
				continue;
			*interval_ms = one[i].publishingInterval;
			found = true;
		}
	}
	UA_Variant_clear(&list);
	return found;
}

/* The library sends an event to everybody who subscribed to it: others get these, too, and may drop
 * what they know already by the ids of the events. */
static UA_StatusCode refresh(UA_Server *server, const UA_NodeId *session, void *session_context,
                             const UA_NodeId *method, void *method_context, const UA_NodeId *object,
                             void *object_context, size_t input_count, const UA_Variant *input,
                             size_t output_count, UA_Variant *output)
{
	struct db_opcua_conditions *conditions = method_context;
	double interval_ms = 0.0;
	UA_StatusCode status;

	(void)session_context;
	(void)method;
	(void)object;
	(void)object_context;
	(void)output_count;
	(void)output;
	if (input_count < 1 || !UA_Variant_hasScalarType(&input[0], &UA_TYPES[UA_TYPES_UINT32]))
		return UA_STATUSCODE_BADINVALIDARGUMENT;
	if (!find_subscription(server, session, *(UA_UInt32 *)input[0].data, &interval_ms))
		return UA_STATUSCODE_BADSUBSCRIPTIONIDINVALID;
	if (conditions->refreshing)
		return UA_STATUSCODE_BADREFRESHINPROGRESS;
	status = tell_bound(conditions, UA_NS0ID_REFRESHSTARTEVENTTYPE,
	                    "The alarms that concern somebody follow");
	if (status != UA_STATUSCODE_GOOD)
		return status;
	conditions->refreshing = true;
	conditions->next = conditions->roster->alarms.list;
	conditions->pause = (db_time)(interval_ms * 2.0) * DB_NS_PER_MS;
	if (conditions->pause > REFRESH_PAUSE_MAX)
		conditions->pause = REFRESH_PAUSE_MAX;
	tell_some(conditions, db_client_now());
	return UA_STATUSCODE_GOOD;
}

/* --- methods of a condition ------------------------------------------------------------------- */

/* Cut off between characters if it is too long. False: it is no text that the service could take.
 */
static bool take_comment(const UA_Variant *input, char comment[DB_OPCUA_COMMENT_MAX])
{
	const UA_LocalizedText *words = input->data;
	size_t length;
	json_t *text;

	if (!UA_Variant_hasScalarType(input, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]))
		return false;
	length = words->text.length;
	if (length >= DB_OPCUA_COMMENT_MAX) {
		length = DB_OPCUA_COMMENT_MAX - 1;
		while (length > 0 && (words->text.data[length] & 0xC0) == 0x80)
			length--;
	}
	if (length > 0)
		memcpy(comment, words->text.data, length);
	comment[length] = '\0';
	text = strlen(comment) == length ? json_string(comment) : NULL;
	json_decref(text);
	return text;
}

static UA_StatusCode acknowledge(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method, void *method_context,
                                 const UA_NodeId *object, void *object_context, size_t input_count,
                                 const UA_Variant *input, size_t output_count, UA_Variant *output)
{
	struct db_opcua_conditions *conditions = method_context;
	const struct db_opcua_roster *roster = conditions->roster;
	enum db_opcua_member member = DB_OPCUA_MEMBERS;
	struct db_opcua_alarm *alarm = NULL;
	char comment[DB_OPCUA_COMMENT_MAX];
	const UA_ByteString *event;
	UA_StatusCode status;

	(void)server;
	(void)session_context;
	(void)method;
	(void)object_context;
	(void)output_count;
	(void)output;
	/* Also the types have this method. */
	if (object->namespaceIndex == roster->space &&
	    object->identifierType == UA_NODEIDTYPE_STRING)
		alarm = db_opcua_alarms_find(&roster->alarms,
		                             (const char *)object->identifier.string.data,
		                             object->identifier.string.length, &member);
	if (!alarm || member != DB_OPCUA_MEMBERS)
		return UA_STATUSCODE_BADNODEIDINVALID;
	if (input_count != 2 ||
	    !UA_Variant_hasScalarType(&input[0], &UA_TYPES[UA_TYPES_BYTESTRING]) ||
	    !take_comment(&input[1], comment))
		return UA_STATUSCODE_BADINVALIDARGUMENT;
	event = input[0].data;
	if (!db_opcua_alarm_has_event(&roster->alarms, alarm, event->data, event->length))
		return UA_STATUSCODE_BADEVENTIDUNKNOWN;
	if (alarm->acknowledged)
		return UA_STATUSCODE_BADCONDITIONBRANCHALREADYACKED;
	status = conditions->acknowledge(conditions->context, session, alarm, comment);
	if (status == UA_STATUSCODE_GOOD) {
		/* The service tells the change in a moment. */
		alarm->acknowledged = true;
		snprintf(alarm->comment, sizeof(alarm->comment), "%s", comment);
	}
	return status;
}

/* Conditions are always enabled, and a comment belongs to an acknowledgement. */
static UA_StatusCode refuse(UA_Server *server, const UA_NodeId *session, void *session_context,
                            const UA_NodeId *method, void *method_context, const UA_NodeId *object,
                            void *object_context, size_t input_count, const UA_Variant *input,
                            size_t output_count, UA_Variant *output)
{
	(void)server;
	(void)session;
	(void)session_context;
	(void)method_context;
	(void)object;
	(void)object_context;
	(void)input_count;
	(void)input;
	(void)output_count;
	(void)output;
	return method->identifier.numeric == UA_NS0ID_CONDITIONTYPE_ENABLE ?
	               UA_STATUSCODE_BADCONDITIONALREADYENABLED :
	               UA_STATUSCODE_BADNOTSUPPORTED;
}

/* The standard has subtypes of UInt32 for the arguments. The library refuses values of UInt32 for
 * them, as which they travel (seen in 1.4.11). */
static UA_StatusCode take_plain_numbers(UA_Server *server, UA_UInt32 arguments)
{
	UA_NodeId node = UA_NODEID_NUMERIC(0, arguments);
	UA_Variant list;
	UA_StatusCode status = UA_Server_readValue(server, node, &list);

	if (status != UA_STATUSCODE_GOOD)
		return status;
	if (list.type == &UA_TYPES[UA_TYPES_ARGUMENT]) {
		UA_Argument *argument = list.data;

		for (size_t i = 0; i < list.arrayLength; i++)
			argument[i].dataType = UA_TYPES[UA_TYPES_UINT32].typeId;
		status = UA_Server_writeValue(server, node, list);
	}
	UA_Variant_clear(&list);
	return status;
}

UA_StatusCode db_opcua_conditions_begin(struct db_opcua_conditions *conditions, UA_Server *server)
{
	static const struct {
		UA_UInt32 node;
		UA_MethodCallback callback;
	} methods[] = {
		{ UA_NS0ID_CONDITIONTYPE_CONDITIONREFRESH, refresh },
		{ UA_NS0ID_CONDITIONTYPE_CONDITIONREFRESH2, refresh },
		{ UA_NS0ID_ACKNOWLEDGEABLECONDITIONTYPE_ACKNOWLEDGE, acknowledge },
		{ UA_NS0ID_CONDITIONTYPE_ENABLE, refuse },
		{ UA_NS0ID_CONDITIONTYPE_DISABLE, refuse },
		{ UA_NS0ID_CONDITIONTYPE_ADDCOMMENT, refuse },
	};
	/* A client that wants all there is asks for each member of the type. The library takes 64
	 * fields, and with all states that an alarm may have there are 85: those that no alarm here
	 * has are not shown. All are optional in the standard. */
	static const UA_UInt32 hidden[] = {
		UA_NS0ID_ALARMCONDITIONTYPE_SUPPRESSEDSTATE,
		UA_NS0ID_ALARMCONDITIONTYPE_OUTOFSERVICESTATE,
		UA_NS0ID_ALARMCONDITIONTYPE_LATCHEDSTATE,
		UA_NS0ID_ALARMCONDITIONTYPE_SILENCESTATE,
		UA_NS0ID_ALARMCONDITIONTYPE_SHELVINGSTATE,
		/* There is no second step after the acknowledgement. */
		UA_NS0ID_ACKNOWLEDGEABLECONDITIONTYPE_CONFIRMEDSTATE,
		UA_NS0ID_ACKNOWLEDGEABLECONDITIONTYPE_CONFIRM,
	};
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	conditions->server = server;
	for (size_t i = 0; i < sizeof(methods) / sizeof(methods[0]); i++) {
		UA_NodeId node = UA_NODEID_NUMERIC(0, methods[i].node);

		status |= UA_Server_setMethodNodeCallback(server, node, methods[i].callback);
		status |= UA_Server_setNodeContext(server, node, conditions);
	}
	status |= take_plain_numbers(server,
	                             UA_NS0ID_CONDITIONTYPE_CONDITIONREFRESH_INPUTARGUMENTS);
	status |= take_plain_numbers(server,
	                             UA_NS0ID_CONDITIONTYPE_CONDITIONREFRESH2_INPUTARGUMENTS);
	for (size_t i = 0; i < sizeof(hidden) / sizeof(hidden[0]); i++)
		status |= UA_Server_deleteNode(server, UA_NODEID_NUMERIC(0, hidden[i]), true);
	return status;
}
