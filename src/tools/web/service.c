/* SPDX-License-Identifier: Apache-2.0 */
#include "web/service.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void lose_link(void *data)
{
	const struct db_web_service *service = data;

	db_plant_fail(service->plant, "the service has closed the connection");
}

static void on_registers(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_web_service *service = data;
	const json_t *reg;
	size_t i;

	(void)more;
	json_array_foreach(error ? NULL : json_object_get(parameters, "registers"), i, reg)
	{
		if (strcmp(db_words_text(reg, "name"), "axis_state") == 0) {
			json_decref(service->states);
			service->states = json_incref(json_object_get(reg, "codes"));
		}
	}
}

static void describe(void *data, json_t *description)
{
	struct db_web_service *service = data;
	const json_t *first = json_array_get(json_object_get(description, "drives"), 0);

	/* These fields change without a change of the plant: streams and jogs continue. */
	(void)json_object_del(description, "configuration_state");
	(void)json_object_del(description, "configuration_since_us");
	(void)json_object_del(description, "configuration_messages");
	/* Services of before have no audit trail. */
	service->has_audit = json_object_del(description, "audit_trouble") == 0;
	/* The codes are the same for all drives. */
	if (!service->states && first)
		(void)db_link_send(db_plant_reader(service->plant), "Registers",
		                   json_pack("{s:s}", "drive", db_words_text(first, "name")), false,
		                   on_registers, service);
	if (service->description && json_equal(service->description, description))
		return;
	json_decref(service->description);
	service->description = json_incref(description);
	service->changed(service->server);
}

static void find(void *data, json_t *description, const struct db_plant_drive *drives, size_t count)
{
	struct db_web_service *service = data;
	struct db_client_error error = { .parameters = NULL };

	(void)drives;
	(void)count;
	if (!service->clock)
		service->clock = db_web_service_open(service, lose_link, service, &error);
	if (service->clock)
		describe(service, description);
	else
		db_plant_fail(service->plant, error.text);
	db_client_error_clear(&error);
}

static void disconnect(struct db_web_service *service)
{
	struct db_link *clock = service->clock;

	/* Each waiting call gets an answer. */
	service->clock = NULL;
	db_link_close(clock);
	json_decref(service->description);
	service->description = NULL;
	json_decref(service->states);
	service->states = NULL;
	service->tokens.count = 0;
	service->asking = false;
}

static void lose(void *data)
{
	struct db_web_service *service = data;

	disconnect(service);
	service->changed(service->server);
}

struct db_web_service *db_web_service_new(struct db_web_server *server,
                                          db_web_service_changed_fn *changed,
                                          db_web_service_token_fn *give_token)
{
	static const struct db_plant_ops ops = {
		.found = find,
		.described = describe,
		.lost = lose,
	};
	const struct db_plant_wishes wishes = { .socket = server->config->socket };
	struct db_web_service *service = calloc(1, sizeof(*service));

	if (!service)
		return NULL;
	service->server = server;
	service->changed = changed;
	service->give_token = give_token;
	service->plant = db_plant_new(server->loop, &wishes, &ops, service);
	if (service->plant)
		return service;
	free(service);
	return NULL;
}

void db_web_service_free(struct db_web_service *service)
{
	if (!service)
		return;
	db_plant_free(service->plant);
	disconnect(service);
	free(service);
}

static void on_token(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct db_web_service *service = data;
	const char *token = json_string_value(json_object_get(parameters, "token"));

	(void)more;
	service->asking = false;
	if (error || !token)
		return;
	db_web_tokens_add(&service->tokens, token, db_client_now());
	service->give_token(service->server, token);
}

void db_web_service_tick(struct db_web_service *service, db_time now)
{
	(void)db_plant_tend(service->plant, now);
	/* Its clock is read while there are pages. */
	if (service->description && !service->asking &&
	    (service->server->streams || service->server->tabs))
		service->asking = db_link_send(service->clock, "Clock", NULL, false, on_token,
		                               service) == 0;
}

json_t *db_web_service_stops(const struct db_web_service *service)
{
	json_t *names = json_array();
	const char *name;
	json_t *mark;

	json_object_foreach(db_plant_stops(service->plant), name, mark)(void)
		json_array_append_new(names, json_string(name));
	return names;
}

bool db_web_service_is_up(const struct db_web_service *service)
{
	return service->description && db_plant_is_there(service->plant);
}

bool db_web_service_is_moving(const struct db_web_service *service, const json_t *axis_state)
{
	static const char *const moving[] = { "DiscreteMotion", "ContinuousMotion", "Homing",
		                              "Stopping" };
	const char *name;
	char number[24];

	snprintf(number, sizeof(number), "%lld", (long long)json_integer_value(axis_state));
	name = json_string_value(json_object_get(service->states, number));
	for (size_t i = 0; name && i < sizeof(moving) / sizeof(moving[0]); i++) {
		if (strcmp(moving[i], name) == 0)
			return true;
	}
	return false;
}

struct db_link *db_web_service_reader(const struct db_web_service *service)
{
	return service->description ? db_plant_reader(service->plant) : NULL;
}

struct db_link *db_web_service_open(struct db_web_service *service, db_link_lost_fn *lost,
                                    void *data, struct db_client_error *error)
{
	return db_link_open(service->server->loop, service->server->config->socket, lost, data,
	                    error);
}
