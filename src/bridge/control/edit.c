/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/message.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* A change is recorded in parts, since a record is short, and no more than these: the rest is in
 * the texts themselves. */
#define PART 440
#define PARTS_MAX 8

static void fail(struct db_session *session, const char *why, json_t *text)
{
	db_session_fail(session, "io.drivebridge.Control.EditFailed",
	                json_pack("{s:s, s:o}", "why", why, "text", text));
}

static void begin(const struct db_call *call, const struct db_edit_request *request)
{
	struct db_session *session = call->session;
	const struct db_control_socket *control = session->control;
	int error = control->setup.ops->edit ?
	                    control->setup.ops->edit(control->setup.context, request) :
	                    -EPERM;

	if (error == 0) {
		session->wait = DB_WAITS_FOR_EDIT;
		session->due = DB_TIME_NEVER;
	} else if (error == -EBUSY) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
	} else if (error == -EPERM) {
		fail(session, "off",
		     json_string(
			     "the configuration cannot be changed here: control { edit = on } in "
			     "the file of root allows it"));
	} else {
		fail(session, "disk", json_string(strerror(-error)));
	}
}

/* --- the calls -------------------------------------------------------------------------------- */

void db_edit_read(const struct db_call *call)
{
	struct db_edit_request request = { .kind = DB_EDIT_READ };
	int64_t former = 0;
	bool given;

	if (!db_session_require_act(call->session) ||
	    !db_call_optional_number(call, "former", 1, UINT32_MAX, &former, &given))
		return;
	request.former = (uint32_t)former;
	begin(call, &request);
}

/* False: the call was answered. */
static bool take_text(const struct db_call *call, const char **text)
{
	if (!db_call_text(call, "text", text))
		return false;
	if (strlen(*text) <= DB_EDIT_TEXT_MAX)
		return true;
	fail(call->session, "long", json_sprintf("a text has %d bytes at most", DB_EDIT_TEXT_MAX));
	return false;
}

void db_edit_check(const struct db_call *call)
{
	struct db_edit_request request = { .kind = DB_EDIT_CHECK };

	if (db_session_require_act(call->session) && take_text(call, &request.text))
		begin(call, &request);
}

void db_edit_set(const struct db_call *call)
{
	struct db_edit_request request = { .kind = DB_EDIT_SET };
	const char *version;
	char *end;

	if (!db_session_require_act(call->session) || !take_text(call, &request.text) ||
	    !db_call_text(call, "version", &version))
		return;
	request.version = strtoull(version, &end, 16);
	if (version[0] == '\0' || *end != '\0') {
		db_session_fail_parameter(call->session, "version");
		return;
	}
	begin(call, &request);
}

/* --- the answer ------------------------------------------------------------------------------- */

/* Who changed which lines. */
static void record(struct db_session *session, const struct db_edit_answer *answer)
{
	const char *at = answer->change ? answer->change : "";

	for (int part = 0; part == 0 || (*at && part < PARTS_MAX); part++) {
		size_t length = strnlen(at, PART);
		char text[PART + 1];

		snprintf(text, sizeof(text), "%.*s", (int)length, at);
		/* One line of the log each. */
		for (char *byte = text; *byte; byte++) {
			if (*byte == '\n' || *byte == '\t')
				*byte = *byte == '\n' ? '|' : ' ';
		}
		at += length;
		db_session_record(session, &(struct db_audit_entry){
						   .kind = DB_AUDIT_RELOAD,
						   .what = "changed",
						   .text = text,
					   });
	}
}

static json_t *version_of(const struct db_edit_answer *answer)
{
	return json_sprintf("%016" PRIx64, answer->version);
}

static void answer_read(struct db_session *session, const struct db_edit_answer *answer)
{
	json_t *text = json_string(answer->text);
	json_t *formers;

	if (!text) {
		fail(session, "disk", json_sprintf("%s is no UTF-8", answer->path));
		return;
	}
	formers = json_array();
	for (size_t i = 0; i < answer->former_count; i++)
		json_array_append_new(formers,
		                      json_pack("{s:I, s:I}", "number",
		                                (json_int_t)answer->formers[i].number, "time_us",
		                                (json_int_t)answer->formers[i].time_us));
	db_session_reply(session,
	                 json_pack("{s:b, s:s, s:o, s:o, s:s, s:o}", "may_edit",
	                           session->control->config->edit, "path", answer->path, "text",
	                           text, "version", version_of(answer), "running",
	                           answer->running ? answer->running : "", "formers", formers),
	                 false);
}

void db_edit_answered(struct db_session *session, const struct db_edit_answer *answer)
{
	bool good = answer->end == DB_EDIT_DONE;

	if (session->wait != DB_WAITS_FOR_EDIT)
		return;
	if (good && answer->kind == DB_EDIT_SET)
		record(session, answer);
	if (answer->end == DB_EDIT_CHANGED)
		fail(session, "changed",
		     json_string(
			     "the configuration was changed meanwhile, by somebody else: read it "
			     "again"));
	else if (answer->end == DB_EDIT_FAILED && answer->kind == DB_EDIT_READ &&
	         answer->error == ENOENT)
		fail(session, "gone", json_string("this former text is not kept any more"));
	else if (answer->end == DB_EDIT_FAILED)
		fail(session, "disk",
		     json_sprintf("%s: %s", answer->path, strerror(answer->error)));
	else if (answer->kind == DB_EDIT_READ)
		answer_read(session, answer);
	else {
		json_t *effects = json_array();

		for (size_t i = 0; i < answer->effect_count; i++) {
			const struct db_edit_effect *effect = &answer->effects[i];

			json_array_append_new(effects,
			                      json_pack("{s:s, s:s?, s:s, s:b}", "bus", effect->bus,
			                                "drive", effect->drive, "text",
			                                effect->text, "moves", effect->moves));
		}
		db_session_reply(session,
		                 json_pack("{s:b, s:o, s:o, s:o}", "good", good, "messages",
		                           db_message_lines(answer->messages), "version",
		                           version_of(answer), "effects", effects),
		                 false);
	}
}
