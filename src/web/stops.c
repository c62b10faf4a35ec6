/* SPDX-License-Identifier: Apache-2.0 */
#include "web/stops.h"
#include "client/log.h"
#include "web/service.h"

#include <stdlib.h>
#include <string.h>

struct place {
	struct db_web_server *server;
	struct db_web_link *link; /* NULL: it is free */
	uint64_t number;          /* the higher, the younger */
	uint64_t request;         /* of the browser, by its number; 0: none */
	json_t *told;             /* by whom, and what; NULL: no request began it */
	struct db_web_caller caller;
	bool lost;
	/* Of who wants to know how it ends; NULL: nobody, or a request. */
	db_client_answer_fn *answer;
	void *data;
};

struct db_web_stops {
	uint64_t last;
	struct place places[DB_WEB_STOPS_MAX];
};

struct db_web_stops *db_web_stops_new(struct db_web_server *server)
{
	struct db_web_stops *stops = calloc(1, sizeof(*stops));

	for (size_t i = 0; stops && i < DB_WEB_STOPS_MAX; i++)
		stops->places[i].server = server;
	return stops;
}

static void leave(struct place *place)
{
	db_web_link_close(place->link);
	json_decref(place->told);
	*place = (struct place){ .server = place->server };
}

void db_web_stops_free(struct db_web_stops *stops)
{
	for (size_t i = 0; stops && i < DB_WEB_STOPS_MAX; i++)
		leave(&stops->places[i]);
	free(stops);
}

static void lose(void *data)
{
	struct place *place = data;

	place->lost = true;
}

/* The browser is not kept waiting any more: the service goes on with the stop. */
static void let_go(struct place *place)
{
	struct db_web_request *request = db_web_request_find(place->server, place->request);

	if (request)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s}", "result", "pending"));
	place->request = 0;
}

/* A place with a connection; NULL: the service takes none. */
static struct place *take_place(struct db_web_stops *stops, const char *user)
{
	struct db_client_error error = { .parameters = NULL };
	struct place *place = &stops->places[0];

	for (size_t i = 1; i < DB_WEB_STOPS_MAX && place->link; i++) {
		if (!stops->places[i].link || stops->places[i].number < place->number)
			place = &stops->places[i];
	}
	let_go(place);
	leave(place);
	place->link = db_web_service_open(place->server->service, lose, place, &error);
	db_client_error_clear(&error);
	if (!place->link)
		return NULL;
	place->number = ++stops->last;
	db_web_link_introduce(place->link, user);
	return place;
}

static void answer_browser(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct place *place = data;
	struct db_web_request *request = db_web_request_find(place->server, place->request);

	(void)more;
	if (request && error)
		db_client_log(DB_CLIENT_NOTICE, "%s: stop failed: %s", place->caller.text,
		              error->text);
	if (request && error)
		db_web_request_fail(request, error);
	else if (request)
		db_web_request_answer(request, MHD_HTTP_OK, json_incref(parameters));
}

/* Where the same of this user waits for its drive already; NULL: nowhere. */
static struct place *find_place(struct db_web_stops *stops, const json_t *told)
{
	for (size_t i = 0; i < DB_WEB_STOPS_MAX; i++) {
		struct place *place = &stops->places[i];

		if (place->link && !place->lost && db_web_link_waiting(place->link) > 0 &&
		    place->told && json_equal(place->told, told))
			return place;
	}
	return NULL;
}

/* Where it was sent; NULL: the service takes no connection more. */
static struct place *send_request(struct db_web_stops *stops, const struct db_web_request *request,
                                  json_t *told)
{
	struct place *place = take_place(stops, request->user);

	if (!place ||
	    db_web_link_send(place->link, request->route.name, json_incref(request->parameters),
	                     false, answer_browser, place) != 0)
		return NULL;
	place->told = json_incref(told);
	place->caller = db_web_request_caller(request);
	return place;
}

bool db_web_stops_call(struct db_web_stops *stops, struct db_web_request *request, db_time within)
{
	struct db_web_server *server = request->server;
	json_t *told = json_pack("{s:s, s:s, s:O}", "user", request->user, "method",
	                         request->route.name, "parameters", request->parameters);
	struct place *place = find_place(stops, told);
	bool is_new = !place;

	if (is_new)
		place = send_request(stops, request, told);
	json_decref(told);
	if (place) {
		let_go(place);
		place->request = request->number;
		request->answer_by = db_web_clock() + within;
	} else if (db_web_service_tell_stop(server->service, request->user, request->route.name,
	                                    json_incref(request->parameters)) == 0) {
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s}", "result", "pending"));
	} else {
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	}
	return is_new;
}

static void take_answer(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct place *place = data;

	if (place->answer)
		place->answer(place->data, parameters, error, more);
}

int db_web_stops_drive(struct db_web_stops *stops, const char *user, const char *drive,
                       db_client_answer_fn *answer, void *data)
{
	json_t *parameters = json_pack("{s:s, s:s}", "drive", drive, "command", "stop");
	struct place *place = take_place(stops, user);

	if (!place) {
		(void)db_web_service_tell_stop(stops->places[0].server->service, user, "Run",
		                               parameters);
		return -1;
	}
	place->answer = answer;
	place->data = data;
	return db_web_link_send(place->link, "Run", parameters, false, take_answer, place);
}

void db_web_stops_forget(struct db_web_stops *stops, const void *data)
{
	for (size_t i = 0; i < DB_WEB_STOPS_MAX; i++) {
		if (stops->places[i].data == data)
			stops->places[i].answer = NULL;
	}
}

void db_web_stops_tick(struct db_web_stops *stops)
{
	for (size_t i = 0; i < DB_WEB_STOPS_MAX; i++) {
		struct place *place = &stops->places[i];

		if (place->link && (place->lost || db_web_link_waiting(place->link) == 0))
			leave(place);
	}
}
