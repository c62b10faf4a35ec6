/* SPDX-License-Identifier: Apache-2.0 */
#include "web/stops.h"
#include "client/lanes.h"
#include "client/log.h"
#include "web/service.h"

#include <stdlib.h>
#include <string.h>

/* A stop of a page, until it is answered. */
struct stop {
	struct db_web_stops *stops;
	struct stop *next;
	uint64_t request; /* the number of the browser's request; 0: none waits */
	json_t *told;     /* user and call */
	struct db_web_caller caller;
};

struct db_web_stops {
	struct db_web_server *server;
	struct db_stops *stops;
	struct stop *waiting;
};

struct db_web_stops *db_web_stops_new(struct db_web_server *server)
{
	struct db_web_stops *stops = calloc(1, sizeof(*stops));

	if (!stops)
		return NULL;
	stops->server = server;
	stops->stops = db_lanes_stops(server->lanes);
	return stops;
}

static void free_stop(struct stop *stop)
{
	struct stop **at = &stop->stops->waiting;

	while (*at != stop)
		at = &(*at)->next;
	*at = stop->next;
	json_decref(stop->told);
	free(stop);
}

/* The browser is answered without the result: the service continues the stop. */
static void let_go(const struct stop *stop)
{
	struct db_web_request *request = db_web_request_find(stop->stops->server, stop->request);

	if (request)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s}", "result", "pending"));
}

static void answer_browser(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct stop *stop = data;
	struct db_web_request *request = db_web_request_find(stop->stops->server, stop->request);

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

bool db_web_stops_call(struct db_web_stops *stops, struct db_web_request *request, db_time within)
{
	json_t *told = json_pack("{s:s, s:s, s:O}", "user", request->user, "method",
	                         request->route.name, "parameters", request->parameters);
	struct stop *stop = stops->waiting;

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
		*stop = (struct stop){
			.stops = stops,
			.next = stops->waiting,
			.request = request->number,
			.told = told,
			.caller = db_web_request_caller(request),
		};
		stops->waiting = stop;
	}
	if (!stop || !db_stops_send(stops->stops, NULL,
	                            &(struct db_stops_user){ stop->caller.user, stop->caller.from },
	                            request->route.name, json_incref(request->parameters), false,
	                            answer_browser, stop)) {
		if (stop)
			free_stop(stop);
		else
			json_decref(told);
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	}
	return true;
}

bool db_web_stops_send(struct db_web_stops *stops, const struct db_web_caller *caller,
                       const char *method, json_t *parameters, db_client_answer_fn *answer,
                       void *data)
{
	return db_stops_send(stops->stops, NULL,
	                     &(struct db_stops_user){ caller->user, caller->from }, method,
	                     parameters, false, answer, data);
}

void db_web_stops_forget(struct db_web_stops *stops, const void *data)
{
	db_stops_forget(stops->stops, data);
}

void db_web_stops_tick(struct db_web_stops *stops)
{
	if (db_web_service_is_up(stops->server->service))
		db_stops_prepare(stops->stops);
}
