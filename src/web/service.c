/* SPDX-License-Identifier: Apache-2.0 */
#include "web/service.h"
#include "client/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TRY_EVERY (1 * DB_NS_PER_S)
/* A service that does not answer for so long is as good as away. */
#define ANSWER_WITHIN (10 * DB_NS_PER_S)

enum { READER, STOPPER, CLOCK, LINKS };

struct db_web_service {
	struct db_web_server *server;
	db_web_service_changed_fn *changed;
	db_web_service_token_fn *give_token;
	void *data;
	struct db_web_link *links[LINKS]; /* all or none */
	json_t *description;
	json_t *states; /* the codes of axis_state */
	db_time try_at;
	db_time answer_by; /* of what this file asks; DB_TIME_NEVER */
	struct db_web_tokens tokens;
	bool asking;    /* for one more */
	char told[512]; /* what was logged last; "" while it is there */
};

struct db_web_service *db_web_service_new(struct db_web_server *server,
                                          db_web_service_changed_fn *changed,
                                          db_web_service_token_fn *give_token, void *data)
{
	struct db_web_service *service = calloc(1, sizeof(*service));

	if (!service)
		return NULL;
	service->server = server;
	service->changed = changed;
	service->give_token = give_token;
	service->data = data;
	service->answer_by = DB_TIME_NEVER;
	return service;
}

static void disconnect(struct db_web_service *service)
{
	for (size_t i = 0; i < LINKS; i++) {
		struct db_web_link *link = service->links[i];

		service->links[i] = NULL;
		db_web_link_close(link);
	}
	json_decref(service->description);
	service->description = NULL;
	json_decref(service->states);
	service->states = NULL;
	service->answer_by = DB_TIME_NEVER;
	service->tokens.count = 0;
	service->asking = false;
}

void db_web_service_free(struct db_web_service *service)
{
	if (service)
		disconnect(service);
	free(service);
}

static void give_up(struct db_web_service *service, const char *why)
{
	bool was_up = service->description;

	if (was_up || strcmp(service->told, why) != 0)
		db_client_log(DB_CLIENT_WARNING, "no connection to drivebridged: %s", why);
	(void)snprintf(service->told, sizeof(service->told), "%s", why);
	disconnect(service);
	service->try_at = db_web_clock() + TRY_EVERY;
	if (was_up)
		service->changed(service->data);
}

static void lose(void *data)
{
	give_up(data, "the service has closed the connection");
}

static const char *name_of(const json_t *object)
{
	const char *name = json_string_value(json_object_get(object, "name"));

	return name ? name : "";
}

static void take_registers(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_web_service *service = data;
	const json_t *reg;
	size_t i;

	(void)more;
	if (!service->links[READER])
		return;
	service->answer_by = DB_TIME_NEVER;
	json_array_foreach(error ? NULL : json_object_get(parameters, "registers"), i, reg)
	{
		if (strcmp(name_of(reg), "axis_state") == 0) {
			json_decref(service->states);
			service->states = json_incref(json_object_get(reg, "codes"));
		}
	}
}

static void take_description(void *data, json_t *parameters, const struct db_client_error *error,
                             bool more)
{
	struct db_web_service *service = data;
	const json_t *first = json_array_get(json_object_get(parameters, "drives"), 0);

	(void)more;
	if (!service->links[READER])
		return;
	service->answer_by = DB_TIME_NEVER;
	if (error) {
		give_up(service, error->text);
		return;
	}
	/* This changes while the plant stays as it is: streams and whoever jogs go on. */
	(void)json_object_del(parameters, "configuration_state");
	(void)json_object_del(parameters, "configuration_since_us");
	(void)json_object_del(parameters, "configuration_messages");
	/* Drives are alike in this. */
	if (!service->states && first &&
	    db_web_link_send(service->links[READER], "Registers",
	                     json_pack("{s:s}", "drive", name_of(first)), false, take_registers,
	                     service) == 0)
		service->answer_by = db_web_clock() + ANSWER_WITHIN;
	if (service->description && json_equal(service->description, parameters))
		return;
	if (!service->description && service->told[0] != '\0')
		db_client_log(DB_CLIENT_NOTICE, "connected to drivebridged");
	service->told[0] = '\0';
	json_decref(service->description);
	service->description = json_incref(parameters);
	service->changed(service->data);
}

void db_web_service_look_again(struct db_web_service *service)
{
	if (!service->links[READER] || service->answer_by != DB_TIME_NEVER)
		return;
	if (db_web_link_send(service->links[READER], "Describe", NULL, false, take_description,
	                     service) == 0)
		service->answer_by = db_web_clock() + ANSWER_WITHIN;
}

static void take_token(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct db_web_service *service = data;
	const char *token = json_string_value(json_object_get(parameters, "token"));

	(void)more;
	if (!service->links[CLOCK])
		return;
	service->asking = false;
	if (error || !token)
		return;
	db_web_tokens_add(&service->tokens, token, db_web_clock());
	service->give_token(service->data, token);
}

/* The time of the service, for pages that are there. */
static void look_at_clock(struct db_web_service *service)
{
	if (service->description && !service->asking &&
	    (service->server->streams || service->server->tabs))
		service->asking = db_web_link_send(service->links[CLOCK], "Clock", NULL, false,
		                                   take_token, service) == 0;
}

void db_web_service_tick(struct db_web_service *service, db_time now)
{
	struct db_client_error error = { .parameters = NULL };

	if (now >= service->answer_by)
		give_up(service, "the service does not answer");
	look_at_clock(service);
	if (service->links[READER] || now < service->try_at)
		return;
	for (size_t i = 0; i < LINKS; i++) {
		service->links[i] = db_web_link_open(service->server->loop,
		                                     service->server->config->socket, lose, service,
		                                     &error);
		if (!service->links[i]) {
			give_up(service, error.text);
			db_client_error_clear(&error);
			return;
		}
	}
	db_web_service_look_again(service);
}

bool db_web_service_is_up(const struct db_web_service *service)
{
	return service->description;
}

json_t *db_web_service_description(const struct db_web_service *service)
{
	return service->description;
}

bool db_web_service_is_moving(const struct db_web_service *service, const json_t *axis_state)
{
	static const char *const moving[] = { "DiscreteMotion", "ContinuousMotion", "Homing",
		                              "Stopping" };
	const char *name;
	char number[24];

	(void)snprintf(number, sizeof(number), "%lld", (long long)json_integer_value(axis_state));
	name = json_string_value(json_object_get(service->states, number));
	for (size_t i = 0; name && i < sizeof(moving) / sizeof(moving[0]); i++) {
		if (strcmp(moving[i], name) == 0)
			return true;
	}
	return false;
}

struct db_web_link *db_web_service_reader(const struct db_web_service *service)
{
	return service->description ? service->links[READER] : NULL;
}

const struct db_web_tokens *db_web_service_tokens(const struct db_web_service *service)
{
	return &service->tokens;
}

int db_web_service_tell_stop(const struct db_web_service *service, const char *user,
                             const char *method, json_t *parameters)
{
	if (!service->description) {
		json_decref(parameters);
		return -1;
	}
	db_web_link_introduce(service->links[STOPPER], user);
	return db_web_link_tell(service->links[STOPPER], method, parameters);
}

struct db_web_link *db_web_service_open(struct db_web_service *service, db_web_link_lost_fn *lost,
                                        void *data, struct db_client_error *error)
{
	return db_web_link_open(service->server->loop, service->server->config->socket, lost, data,
	                        error);
}
