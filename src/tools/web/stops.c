/* SPDX-License-Identifier: Apache-2.0 */
#include "web/stops.h"
#include "client/lanes.h"
#include "client/log.h"

#include <stdlib.h>
#include <string.h>

/* A stop of a page, until it is answered. */
struct db_web_stop {
	struct db_web_server *server;
	struct db_web_stop *next;
	uint64_t request; /* the number of the browser's request; 0: none waits */
	json_t *told;     /* user and call */
	struct db_web_caller caller;
};

static void free_stop(struct db_web_stop *stop)
{
	struct db_web_stop **at = &stop->server->stops;

	while (*at != stop)
		at = &(*at)->next;
	*at = stop->next;
	json_decref(stop->told);
	free(stop);
}

/* The browser is answered without the result: the service continues the stop. */
static void let_go(const struct db_web_stop *stop)
{
	struct db_web_request *request = db_web_request_find(stop->server, stop->request);

	if (request)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s}", "result", "pending"));
}

static void answer_browser(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_web_stop *stop = data;
	struct db_web_request *request = db_web_request_find(stop->server, stop->request);

	(void)more;
	if (error && strcmp(error->name, DB_STOPS_PENDING) == 0) {
		let_go(stop);
	} else if (request && error) {
		db_client_log(DB_CLIENT_NOTICE, "%s: stop failed: %s", stop->caller.text,
		              error->text);
		db_web_request_fail(request, error);
	} else if (request) {
		db_web_request_answer(request, MHD_HTTP_OK, json_incref(parameters));
	}
	free_stop(stop);
}

bool db_web_stops_call(struct db_web_request *request, db_time within)
{
	struct db_web_server *server = request->server;
	json_t *told = json_pack("{s:s, s:s, s:O}", "user", request->user, "method",
	                         request->route.name, "parameters", request->parameters);
	struct db_web_stop *stop = server->stops;

	request->answer_by = db_client_now() + within;
	while (stop && !json_equal(stop->told, told))
		stop = stop->next;
	if (stop) {
		let_go(stop);
		stop->request = request->number;
		json_decref(told);
		return false;
	}
	stop = calloc(1, sizeof(*stop));
	if (stop) {
		*stop = (struct db_web_stop){
			.server = server,
			.next = server->stops,
			.request = request->number,
			.told = told,
			.caller = db_web_request_caller(request),
		};
		server->stops = stop;
	}
	if (!stop || !db_web_stops_send(server, &stop->caller, request->route.name,
	                                json_incref(request->parameters), answer_browser, stop)) {
		if (stop)
			free_stop(stop);
		else
			json_decref(told);
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	}
	return true;
}

bool db_web_stops_send(struct db_web_server *server, const struct db_web_caller *caller,
                       const char *method, json_t *parameters, db_client_answer_fn *answer,
                       void *data)
{
	return db_stops_send(db_lanes_stops(server->lanes), NULL,
	                     &(struct db_stops_user){ caller->user, caller->from }, method,
	                     parameters, false, answer, data);
}
