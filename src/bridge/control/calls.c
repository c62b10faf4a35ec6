/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/act.h"
#include "control/call.h"
#include "drivebridge/version.h"

#include <string.h>

#define SERVICE "org.varlink.service"
#define CONTROL "io.drivebridge.Control"
#define BEAT CONTROL ".Beat"

/* As in varlink's definition. */
static const char service_description[] =
	"# What every varlink service answers.\n"
	"interface " SERVICE "\n"
	"\n"
	"method GetInfo() -> (\n"
	"\tvendor: string,\n"
	"\tproduct: string,\n"
	"\tversion: string,\n"
	"\turl: string,\n"
	"\tinterfaces: []string\n"
	")\n"
	"\n"
	"method GetInterfaceDescription(interface: string) -> (description: string)\n"
	"\n"
	"error InterfaceNotFound (interface: string)\n"
	"error MethodNotFound (method: string)\n"
	"error MethodNotImplemented (method: string)\n"
	"error InvalidParameter (parameter: string)\n"
	"error PermissionDenied ()\n"
	"error ExpectedMore ()\n";

static void get_info(const struct db_call *call)
{
	db_session_reply(call->session,
	                 json_pack("{s:s, s:s, s:s, s:s, s:[s, s]}", "vendor", "drivebridge",
	                           "product", "drivebridge", "version", DB_VERSION, "url", "",
	                           "interfaces", SERVICE, CONTROL),
	                 false);
}

static void get_description(const struct db_call *call)
{
	const char *interface;

	if (!db_call_text(call, "interface", &interface))
		return;
	if (strcmp(interface, SERVICE) == 0)
		db_session_reply(call->session,
		                 json_pack("{s:s}", "description", service_description), false);
	else if (strcmp(interface, CONTROL) == 0)
		db_session_reply(call->session,
		                 json_pack("{s:s}", "description", db_calls_interface), false);
	else
		db_session_fail(call->session, SERVICE ".InterfaceNotFound",
		                json_pack("{s:s}", "interface", interface));
}

static const struct method {
	const char *name;
	void (*call)(const struct db_call *call);
	const char *parameters; /* separated by spaces */
	bool stream;            /* only with `more` */
} methods[] = {
	{ SERVICE ".GetInfo", get_info, " ", false },
	{ SERVICE ".GetInterfaceDescription", get_description, " interface ", false },
	{ CONTROL ".Describe", db_look_describe, " ", false },
	{ CONTROL ".Registers", db_look_registers, " drive windows ", false },
	{ CONTROL ".Commands", db_look_commands, " drive ", false },
	{ CONTROL ".Read", db_look_read, " drive names ", false },
	{ CONTROL ".Introduce", db_act_introduce, " user from ", false },
	{ CONTROL ".Clock", db_held_clock, " ", false },
	{ CONTROL ".Write", db_act_write, " drive values standing token id within_ms sent_us ",
	  false },
	{ CONTROL ".Run", db_act_run,
	  " drive command arguments position until_end hold_ms token not_stopped_since id "
	  "within_ms sent_us ",
	  false },
	{ BEAT, db_held_beat, " drive token ", false },
	{ CONTROL ".Stop", db_stops_call, " drives command wait_ms ", false },
	{ CONTROL ".Subscribe", db_streams_subscribe, " drives names interval_ms changes ", true },
	{ CONTROL ".Events", db_streams_events, " ", false },
	{ CONTROL ".Troubles", db_troubles_call, " drives ", false },
	{ CONTROL ".Trace", db_traces_follow, " bus kept past ", true },
	{ CONTROL ".Traces", db_traces_list, " ", false },
	{ CONTROL ".Figures", db_look_figures, " ", false },
	{ CONTROL ".Reload", db_streams_reload, " ", false },
	{ CONTROL ".Configuration", db_edit_read, " former ", false },
	{ CONTROL ".CheckConfiguration", db_edit_check, " text ", false },
	{ CONTROL ".SetConfiguration", db_edit_set, " text version ", false },
	{ CONTROL ".Scan", db_scan_call, " bus first last all_speeds speeds ", false },
	{ CONTROL ".SetUp", db_scan_set_up, " bus address what value speeds ", false },
	{ CONTROL ".Metrics", db_metrics_call, " ", false },
	{ CONTROL ".Audit", db_audit_call, " from since_us drive who refused verify ", false },
	{ CONTROL ".Health", db_health_call, " drive since_us step_s ", false },
	{ CONTROL ".HealthRows", db_health_rows_call, " since_us step_s ", false },
	{ CONTROL ".Alarms", db_alarms_call, " after ", false },
	{ CONTROL ".AcknowledgeAlarm", db_alarms_acknowledge_call, " id drive comment ", false },
	{ CONTROL ".Positions", db_positions_call, " drive ", false },
	{ CONTROL ".Teach", db_positions_teach, " drive name keep ", false },
	{ CONTROL ".Forget", db_positions_forget, " drive name ", false },
	{ CONTROL ".Note", db_audit_note, " kind what user from text refused drive ", false },
};

static void refuse_method(struct db_session *session, const char *name)
{
	const char *dot = strrchr(name, '.');
	int length = dot ? (int)(dot - name) : 0;
	char interface[64];

	snprintf(interface, sizeof(interface), "%.*s", length, name);
	if (strcmp(interface, SERVICE) == 0 || strcmp(interface, CONTROL) == 0)
		db_session_fail(session, SERVICE ".MethodNotFound",
		                json_pack("{s:s}", "method", name));
	else
		db_session_fail(session, SERVICE ".InterfaceNotFound",
		                json_pack("{s:s}", "interface", interface));
}

/* The first parameter that is unknown to the method; null. */
static const char *find_foreign(const struct method *method, json_t *parameters)
{
	const char *name;
	json_t *value;

	json_object_foreach(parameters, name, value)
	{
		char word[32];

		(void)value;
		snprintf(word, sizeof(word), " %s ", name);
		if (strlen(name) > 24 || strchr(name, ' ') || !strstr(method->parameters, word))
			return name;
	}
	return NULL;
}

bool db_calls_has_next(struct db_session *session, size_t *length)
{
	size_t whole;

	if (db_session_has_message(session, length))
		return true;
	if (session->broken || !db_session_has_whole(session, &whole))
		return false;
	/* A beat without an answer need not wait for the answers before it. */
	if (session->next == DB_NEXT_UNKNOWN) {
		struct db_message message;
		bool beats = !db_message_parse(session->in, whole, &message) && message.oneway &&
		             strcmp(message.method, BEAT) == 0;

		db_message_clear(&message);
		session->next = beats ? DB_NEXT_BEATS : DB_NEXT_WAITS;
	}
	if (session->next == DB_NEXT_WAITS)
		return false;
	*length = whole;
	return true;
}

void db_calls_take(struct db_session *session, const char *text, size_t length)
{
	struct db_message message;
	const char *wrong = db_message_parse(text, length, &message);
	struct db_call call = { .session = session, .parameters = message.parameters };
	const struct method *method = NULL;
	const char *foreign;

	session->control->stats.calls++;
	/* A call is in progress, whose answer is still to come. */
	if (session->next == DB_NEXT_BEATS) {
		db_held_beat_silently(&call);
		db_message_clear(&message);
		return;
	}
	session->more = message.more;
	session->oneway = message.oneway;
	session->repeated = false;
	if (wrong) {
		db_session_fail_parameter(session, wrong);
		return;
	}
	if (session->stops_only && !db_stops_has_place(&message)) {
		/* The place is reserved for the next stop. */
		db_session_fail(session, CONTROL ".Busy", NULL);
		session->broken = true;
		db_message_clear(&message);
		return;
	}
	for (size_t i = 0; !method && i < sizeof(methods) / sizeof(methods[0]); i++) {
		if (strcmp(methods[i].name, message.method) == 0)
			method = &methods[i];
	}
	if (method)
		session->method = strrchr(method->name, '.') + 1;
	foreign = method ? find_foreign(method, message.parameters) : NULL;
	if (!method)
		refuse_method(session, message.method);
	else if (foreign)
		db_session_fail_parameter(session, foreign);
	else if (method->stream && (!message.more || message.oneway))
		db_session_fail(session, SERVICE ".ExpectedMore", NULL);
	else
		method->call(&call);
	db_message_clear(&message);
}
