/* SPDX-License-Identifier: Apache-2.0 */
#include "web/call.h"
#include "client/log.h"
#include "web/service.h"

#include <stdlib.h>
#include <string.h>

/* Connections of calls aside at the same time: the service carries out one after the other. */
#define LINKS_MAX 4

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
	if (request && error && ticket->acts && strcmp(error->name, DB_CLIENT_LOST) == 0)
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "the service has closed the connection; whether it was "
		                      "carried out is not known");
	else if (request && error)
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

/* --- aside ------------------------------------------------------------------------------------ */

struct aside {
	struct db_web_request *request;
	struct db_link *link;
	void (*answer)(struct db_web_request *request, json_t *parameters);
};

static void end_aside(void *job)
{
	struct aside *aside = job;

	if (aside->link)
		aside->request->server->calls_aside--;
	db_link_drop(aside->link);
	free(aside);
}

static void on_aside(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	const struct aside *aside = data;

	(void)more;
	if (error)
		db_web_request_fail(aside->request, error);
	else
		aside->answer(aside->request, parameters);
}

void db_web_call_aside(struct db_web_request *request, const char *method, json_t *parameters,
                       db_time within,
                       void (*answer)(struct db_web_request *request, json_t *parameters))
{
	struct db_client_error error = { .parameters = NULL };
	struct db_web_server *server = request->server;
	struct aside *aside = server->calls_aside < LINKS_MAX ? calloc(1, sizeof(*aside)) : NULL;

	if (!aside) {
		request->retry_s = 1;
		json_decref(parameters);
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "others are reading what takes long");
		return;
	}
	*aside = (struct aside){ .request = request, .answer = answer };
	/* When it is lost, its call is answered with that; it is closed with the request. */
	aside->link = db_web_service_open(server->service, NULL, NULL, &error);
	request->job = aside;
	request->end_job = end_aside;
	request->answer_by = db_client_now() + within;
	if (aside->link)
		server->calls_aside++;
	if (!aside->link) {
		db_web_request_fail(request, &error);
		json_decref(parameters);
	} else if (db_link_send(aside->link, method, parameters, false, on_aside, aside) != 0) {
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	}
	db_client_error_clear(&error);
}

/* --- the log ---------------------------------------------------------------------------------- */

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
