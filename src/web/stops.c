/* SPDX-License-Identifier: Apache-2.0 */
#include "web/stops.h"
#include "web/call.h"
#include "web/service.h"

#include <stdlib.h>

struct place {
	struct db_web_link *link; /* NULL: it is free */
	uint64_t number;          /* the higher, the younger */
	uint64_t request;         /* of the browser, by its number; 0: none */
	bool lost;
	/* Of who wants to know how it ends; NULL: nobody, or a request. */
	db_client_answer_fn *answer;
	void *data;
};

struct db_web_stops {
	struct db_web_server *server;
	uint64_t last;
	struct place places[DB_WEB_STOPS_MAX];
};

struct db_web_stops *db_web_stops_new(struct db_web_server *server)
{
	struct db_web_stops *stops = calloc(1, sizeof(*stops));

	if (stops)
		stops->server = server;
	return stops;
}

static void leave(struct place *place)
{
	db_web_link_close(place->link);
	*place = (struct place){ .link = NULL };
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

/* It gives its place up: the service goes on with it. */
static void give_way(struct db_web_stops *stops, struct place *place)
{
	struct db_web_request *request = place->link ? stops->server->requests : NULL;

	while (request && request->number != place->request)
		request = request->next;
	if (request)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s}", "result", "pending"));
	leave(place);
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
	give_way(stops, place);
	place->link = db_web_service_open(stops->server->service, lose, place, &error);
	db_client_error_clear(&error);
	if (!place->link)
		return NULL;
	place->number = ++stops->last;
	db_web_link_introduce(place->link, user);
	return place;
}

void db_web_stops_call(struct db_web_stops *stops, struct db_web_request *request, db_time within)
{
	struct place *place = take_place(stops, request->user);

	if (place) {
		place->request = request->number;
		db_web_call(request, place->link, within);
		return;
	}
	if (db_web_service_tell_stop(stops->server->service, request->user, request->route.name,
	                             json_incref(request->parameters)) == 0)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s}", "result", "pending"));
	else
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
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
		(void)db_web_service_tell_stop(stops->server->service, user, "Run", parameters);
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
