/* SPDX-License-Identifier: Apache-2.0 */
#include "web/call.h"
#include "client/log.h"

#include <stdlib.h>
#include <string.h>

/* Bytes per log line. */
#define PART 700

struct ticket {
	struct db_web_server *server;
	uint64_t number; /* of the request */
	bool acts;
	struct db_web_caller caller;
	const char *method;
};

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct ticket *ticket = data;
	struct db_web_request *request = db_web_request_find(ticket->server, ticket->number);

	(void)more;
	if (error && ticket->acts)
		db_client_log(DB_CLIENT_NOTICE, "%s: %s failed: %s", ticket->caller.text,
		              ticket->method, error->text);
	if (request && error)
		db_web_request_fail(request, error);
	else if (request)
		db_web_request_answer(request, MHD_HTTP_OK, json_incref(parameters));
	free(ticket);
}

void db_web_call(struct db_web_request *request, struct db_link *link, db_time within)
{
	struct ticket *ticket = link ? calloc(1, sizeof(*ticket)) : NULL;

	if (ticket) {
		*ticket = (struct ticket){
			.server = request->server,
			.number = request->number,
			.acts = request->route.acts,
			.caller = db_web_request_caller(request),
			.method = request->route.name,
		};
		request->answer_by = db_client_now() + within;
	}
	if (!ticket || db_link_send(link, request->route.name, json_incref(request->parameters),
	                            false, on_answer, ticket) != 0) {
		free(ticket);
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	}
}

void db_web_log_action(const struct db_web_request *request, const char *what,
                       const json_t *parameters)
{
	char *text = parameters ? json_dumps(parameters, JSON_COMPACT) : NULL;
	struct db_web_caller caller = db_web_request_caller(request);

	db_client_log(DB_CLIENT_NOTICE, "%s: %s%s%.*s", caller.text, what, text ? " " : "", PART,
	              text ? text : "");
	/* A longer text continues in further lines. */
	for (size_t at = PART; text && at < strlen(text); at += PART)
		db_client_log(DB_CLIENT_NOTICE, "%s: ... %.*s", caller.text, PART, text + at);
	free(text);
}
