/* SPDX-License-Identifier: Apache-2.0 */
#include "web/health.h"
#include "web/call.h"
#include "web/service.h"
#include "web/tabs.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

/* A disk that fails takes seconds. */
#define ANSWER_WITHIN (10 * DB_NS_PER_S)
#define WEEK_S (7 * 24 * 3600)
#define NUMBER_MAX INT64_C(9007199254740992)

/* --- values ----------------------------------------------------------------------------------- */

static void answer_values(struct db_web_request *request, json_t *parameters)
{
	json_t *rows = json_object_get(parameters, "rows");

	/* Of the user's drives alone. */
	for (size_t i = json_array_size(rows); i-- > 0;) {
		if (!db_grant_has_drive(&request->grant,
		                        db_words_text(json_array_get(rows, i), "drive")))
			(void)json_array_remove(rows, i);
	}
	(void)json_object_set_new(parameters, "now_us", json_integer(db_client_wall_us()));
	request->packable = true;
	db_web_request_answer(request, MHD_HTTP_OK, json_incref(parameters));
}

void db_web_health(struct db_web_request *request)
{
	const json_t *span = json_object_get(request->parameters, "for_s");
	json_t *step = json_object_get(request->parameters, "step_s");
	json_t *drive = json_object_get(request->parameters, "drive");
	bool of_drive = strcmp(request->route.name, "Health") == 0;
	json_int_t since_us;
	json_t *query;

	if (!json_is_integer(span) || json_integer_value(span) < 1 ||
	    json_integer_value(span) > WEEK_S || !json_is_integer(step) ||
	    (of_drive &&
	     (!json_is_string(drive) || db_words_text(request->parameters, "drive")[0] == '\0'))) {
		db_web_request_refuse(
			request, MHD_HTTP_BAD_REQUEST, "BadRequest",
			"right is {\"for_s\": 1 to %d, \"step_s\": 60, 900 or 3600%s}", WEEK_S,
			of_drive ? ", \"drive\": a name" : "");
		return;
	}
	if (of_drive && !db_grant_has_drive(&request->grant, json_string_value(drive))) {
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "NotAllowed",
		                      "%.40s is not among this user's drives: %s",
		                      json_string_value(drive), request->grant.drives);
		return;
	}
	/* By this machine's clock, which is the service's; a browser's may be wrong. */
	since_us = db_client_wall_us() - json_integer_value(span) * 1000000;
	if (since_us < 1)
		since_us = 1;
	query = json_pack("{s:I, s:O, s:O*}", "since_us", since_us, "step_s", step, "drive",
	                  of_drive ? drive : NULL);
	if (query)
		db_web_call_aside(request, request->route.name, query, ANSWER_WITHIN,
		                  answer_values);
}

/* --- alarms ----------------------------------------------------------------------------------- */

struct ticket {
	struct db_web_server *server;
	uint64_t number; /* of the request */
};

static void on_alarms(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct ticket *ticket = data;
	struct db_web_request *request = db_web_request_find(ticket->server, ticket->number);
	json_t *alarms = json_object_get(parameters, "alarms");

	(void)more;
	free(ticket);
	if (!request)
		return;
	if (error) {
		db_web_request_fail(request, error);
		return;
	}
	for (size_t i = json_array_size(alarms); i-- > 0;) {
		const json_t *alarm = json_array_get(alarms, i);

		if (strcmp(db_words_text(alarm, "kind"), "drive") == 0 &&
		    !db_grant_has_drive(&request->grant, db_words_text(alarm, "name")))
			(void)json_array_remove(alarms, i);
	}
	db_web_request_answer(request, MHD_HTTP_OK, json_incref(parameters));
}

void db_web_alarms(struct db_web_request *request)
{
	json_t *after = json_object_get(request->parameters, "after");
	struct db_link *link = db_web_service_reader(request->server->service);
	struct ticket *ticket;

	if (!json_is_integer(after) || json_integer_value(after) < 0 ||
	    json_integer_value(after) > NUMBER_MAX) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "right is {\"after\": a number}");
		return;
	}
	ticket = link ? calloc(1, sizeof(*ticket)) : NULL;
	if (ticket) {
		*ticket = (struct ticket){ .server = request->server, .number = request->number };
		request->answer_by = db_client_now() + ANSWER_WITHIN;
	}
	if (!ticket || db_link_send(link, "Alarms", json_pack("{s:O}", "after", after), false,
	                            on_alarms, ticket) != 0) {
		free(ticket);
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	}
}

void db_web_acknowledge(struct db_web_request *request)
{
	struct db_link *link;

	db_web_log_action(request, request->route.name, request->parameters);
	/* Its drive is not commanded, so it is not fed either. */
	link = db_web_tabs_begin(request, NULL);
	if (link)
		db_web_call(request, link, ANSWER_WITHIN);
}
