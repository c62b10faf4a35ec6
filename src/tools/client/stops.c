/* SPDX-License-Identifier: Apache-2.0 */
#include "client/stops.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct place {
	struct db_stops *stops;
	struct db_link *link; /* NULL: it is free */
	uint64_t number;      /* higher is younger */
	char key[96];
	char user[DB_LINK_USER_MAX + 1];
	char from[DB_LINK_FROM_MAX + 1];
	char method[32];
	json_t *parameters;
	db_client_answer_fn *answer;
	void *data;
};

struct db_stops {
	sd_event *loop;
	const char *path;
	struct db_link *standby; /* for stops without an answer; NULL: not open */
	uint64_t last;
	size_t count;
	struct place places[];
};

struct db_stops *db_stops_new(sd_event *loop, const char *path, size_t places)
{
	struct db_stops *stops = calloc(1, sizeof(*stops) + places * sizeof(stops->places[0]));

	if (!stops)
		return NULL;
	stops->loop = loop;
	stops->path = path;
	stops->count = places;
	for (size_t i = 0; i < places; i++)
		stops->places[i].stops = stops;
	return stops;
}

/* Also when its connection is lost: its call has been answered by then. */
static void clear_place(void *data)
{
	struct place *place = data;

	db_link_drop(place->link);
	json_decref(place->parameters);
	*place = (struct place){ .stops = place->stops };
}

/* Ends the waiting for the answer with this error. */
static void end_place(struct place *place, const char *name, const char *text)
{
	struct db_client_error error = { .parameters = NULL };
	db_client_answer_fn *answer = place->answer;
	void *data = place->data;

	clear_place(place);
	db_client_error_set(&error, name, "%s", text);
	if (answer)
		answer(data, NULL, &error, false);
	db_client_error_clear(&error);
}

bool db_stops_drop(struct db_stops *stops)
{
	bool any = stops->standby;

	db_link_drop(stops->standby);
	stops->standby = NULL;
	for (size_t i = 0; i < stops->count; i++) {
		if (!stops->places[i].link)
			continue;
		any = true;
		end_place(&stops->places[i], DB_CLIENT_LOST, "the connection is closed");
	}
	return any;
}

static void lose_standby(void *data)
{
	struct db_stops *stops = data;

	db_link_drop(stops->standby);
	stops->standby = NULL;
}

void db_stops_prepare(struct db_stops *stops)
{
	struct db_client_error error = { .parameters = NULL };

	if (!stops->standby)
		stops->standby = db_link_open(stops->loop, stops->path, lose_standby, stops,
		                              &error);
	db_client_error_clear(&error);
}

/* Without an answer. Takes `parameters` over. False: there is no connection. */
static bool tell(struct db_stops *stops, const struct db_stops_user *user, const char *method,
                 json_t *parameters)
{
	db_stops_prepare(stops);
	if (!stops->standby) {
		json_decref(parameters);
		return false;
	}
	/* Nobody waits for that. */
	(void)json_object_del(parameters, "until_end");
	db_link_introduce_now(stops->standby, user->name, user->from);
	return db_link_tell(stops->standby, method, parameters) == 0;
}

static const char overload[] = "too much is commanded at the same time to wait for its end";

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct place *place = data;
	db_client_answer_fn *answer = place->answer;
	void *context = place->data;

	/* The service has no room for a further connection. */
	if (error && strcmp(error->name, DB_CLIENT_SERVICE "Busy") == 0 &&
	    tell(place->stops, &(struct db_stops_user){ place->user, place->from }, place->method,
	         json_incref(place->parameters))) {
		end_place(place, DB_STOPS_PENDING, overload);
		return;
	}
	if (!more)
		clear_place(place);
	if (answer)
		answer(context, parameters, error, more);
}

/* A free place, that of a former stop with this key, or that of the oldest one. */
static struct place *take_place(struct db_stops *stops, const char *key)
{
	struct place *place = &stops->places[0];

	for (size_t i = 0; i < stops->count; i++) {
		struct place *one = &stops->places[i];

		if (key && one->link && strcmp(one->key, key) == 0) {
			place = one;
			break;
		}
		if (place->link && (!one->link || one->number < place->number))
			place = one;
	}
	if (place->link)
		end_place(place, DB_STOPS_PENDING, "another stop has taken its place");
	/* What was told may have sent a stop. */
	clear_place(place);
	return place;
}

bool db_stops_send(struct db_stops *stops, const char *key, const struct db_stops_user *user,
                   const char *method, json_t *parameters, bool more, db_client_answer_fn *answer,
                   void *data)
{
	struct db_client_error error = { .parameters = NULL };
	struct place *place = take_place(stops, key);

	place->link = db_link_open(stops->loop, stops->path, clear_place, place, &error);
	place->number = ++stops->last;
	place->parameters = json_incref(parameters);
	place->answer = answer;
	place->data = data;
	snprintf(place->method, sizeof(place->method), "%s", method);
	snprintf(place->key, sizeof(place->key), "%s", key ? key : "");
	snprintf(place->user, sizeof(place->user), "%s", user->name);
	snprintf(place->from, sizeof(place->from), "%s", user->from);
	db_client_error_clear(&error);
	if (place->link) {
		db_link_introduce(place->link, user->name, user->from, NULL, NULL);
		if (db_link_send(place->link, method, json_incref(parameters), more, on_answer,
		                 place) == 0) {
			json_decref(parameters);
			return true;
		}
	}
	if (tell(stops, user, method, parameters)) {
		end_place(place, DB_STOPS_PENDING, overload);
		return true;
	}
	clear_place(place);
	return false;
}

void db_stops_forget(struct db_stops *stops, const void *data)
{
	for (size_t i = 0; i < stops->count; i++) {
		if (stops->places[i].data == data)
			stops->places[i].answer = NULL;
	}
}

struct db_link *db_stops_link(const struct db_stops *stops, const void *data)
{
	for (size_t i = 0; i < stops->count; i++) {
		if (stops->places[i].link && stops->places[i].data == data)
			return stops->places[i].link;
	}
	return NULL;
}
