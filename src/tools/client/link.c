/* SPDX-License-Identifier: Apache-2.0 */
#include "client/link.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>

/* A waiting call. The client uses its address until the last answer. */
struct call {
	struct db_link *link;
	db_client_answer_fn *answer;
	void *data;
	struct call *next;
};

struct db_link {
	struct db_client *client;
	sd_event_source *source;
	db_link_lost_fn *lost;
	void *data;
	struct call *calls;
	bool handling; /* within db_client_handle() */
	bool closed;   /* to be freed when that returns */
	bool held;
	char user[DB_LINK_USER_MAX + 1]; /* the one introduced last */
	char from[DB_LINK_FROM_MAX + 1];
};

static void watch(struct db_link *link)
{
	uint32_t events = link->held ? 0 : EPOLLIN;

	if (db_client_poll_fd(link->client).events & POLLOUT)
		events |= EPOLLOUT;
	(void)sd_event_source_set_io_events(link->source, events);
}

static void free_link(struct db_link *link)
{
	db_client_close(link->client);
	while (link->calls) {
		struct call *call = link->calls;

		link->calls = call->next;
		free(call);
	}
	free(link);
}

void db_link_handle(struct db_link *link)
{
	int result;

	if (link->closed || link->handling)
		return;
	link->handling = true;
	result = db_client_handle(link->client);
	link->handling = false;
	if (link->closed) {
		free_link(link);
	} else if (result != 0) {
		(void)sd_event_source_set_enabled(link->source, SD_EVENT_OFF);
		if (link->lost)
			link->lost(link->data);
	} else {
		watch(link);
	}
}

static int on_ready(sd_event_source *source, int fd, uint32_t events, void *data)
{
	(void)source;
	(void)fd;
	(void)events;
	db_link_handle(data);
	return 0;
}

struct db_link *db_link_open(sd_event *loop, const char *path, db_link_lost_fn *lost, void *data,
                             struct db_client_error *error)
{
	struct db_link *link = calloc(1, sizeof(*link));

	if (!link) {
		db_client_error_set(error, DB_CLIENT_NO_MEMORY, "no memory");
		return NULL;
	}
	link->lost = lost;
	link->data = data;
	if (db_client_open(path, &link->client, error) != 0) {
		free(link);
		return NULL;
	}
	if (sd_event_add_io(loop, &link->source, db_client_poll_fd(link->client).fd, EPOLLIN,
	                    on_ready, link) < 0) {
		db_client_error_set(error, DB_CLIENT_NO_MEMORY, "no memory");
		free_link(link);
		return NULL;
	}
	return link;
}

static void leave_loop(struct db_link *link)
{
	link->closed = true;
	(void)sd_event_source_set_enabled(link->source, SD_EVENT_OFF);
	link->source = sd_event_source_unref(link->source);
}

void db_link_drop(struct db_link *link)
{
	if (!link || link->closed)
		return;
	leave_loop(link);
	for (struct call *call = link->calls; call; call = call->next)
		call->answer = NULL;
	if (!link->handling)
		free_link(link);
}

void db_link_close(struct db_link *link)
{
	struct db_client_error error = { .parameters = NULL };

	if (!link || link->closed)
		return;
	leave_loop(link);
	db_client_error_set(&error, DB_CLIENT_LOST, "the service has closed the connection");
	for (struct call *call = link->calls; call; call = call->next) {
		db_client_answer_fn *answer = call->answer;

		/* Only the first answer. */
		call->answer = NULL;
		if (answer)
			answer(call->data, NULL, &error, false);
	}
	db_client_error_clear(&error);
	if (!link->handling)
		free_link(link);
}

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct call *call = data;
	db_client_answer_fn *answer = call->answer;
	void *context = call->data;

	if (!more) {
		for (struct call **at = &call->link->calls; *at; at = &(*at)->next) {
			if (*at == call) {
				*at = call->next;
				break;
			}
		}
		free(call);
	}
	if (answer)
		answer(context, parameters, error, more);
}

int db_link_send(struct db_link *link, const char *method, json_t *parameters, bool more,
                 db_client_answer_fn *answer, void *data)
{
	struct call *call = link->closed ? NULL : calloc(1, sizeof(*call));

	if (!call) {
		json_decref(parameters);
		return -1;
	}
	*call = (struct call){ .link = link, .answer = answer, .data = data, .next = link->calls };
	link->calls = call;
	if (db_client_send(link->client, method, parameters, more, on_answer, call) != 0) {
		link->calls = call->next;
		free(call);
		return -1;
	}
	if (!link->handling)
		watch(link);
	return 0;
}

int db_link_tell(struct db_link *link, const char *method, json_t *parameters)
{
	if (link->closed) {
		json_decref(parameters);
		return -1;
	}
	if (db_client_tell(link->client, method, parameters) != 0)
		return -1;
	if (!link->handling)
		watch(link);
	return 0;
}

unsigned db_link_waiting(const struct db_link *link)
{
	return db_client_waiting(link->client);
}

void db_link_hold(struct db_link *link, bool hold)
{
	if (link->closed || link->held == hold)
		return;
	link->held = hold;
	if (!link->handling)
		watch(link);
}

/* The parameters of the call; NULL: it is needless. */
static json_t *take_user(struct db_link *link, const char *user, const char *from)
{
	if (strcmp(link->user, user) == 0 && strcmp(link->from, from) == 0)
		return NULL;
	snprintf(link->user, sizeof(link->user), "%s", user);
	snprintf(link->from, sizeof(link->from), "%s", from);
	return json_pack("{s:s, s:s*}", "user", user, "from", from[0] ? from : NULL);
}

void db_link_introduce(struct db_link *link, const char *user, const char *from,
                       db_client_answer_fn *answer, void *data)
{
	json_t *parameters = take_user(link, user, from);

	if (parameters)
		(void)db_link_send(link, "Introduce", parameters, false, answer, data);
}

const char *db_link_user(const struct db_link *link)
{
	return link->user;
}

void db_link_introduce_now(struct db_link *link, const char *user, const char *from)
{
	json_t *parameters = take_user(link, user, from);

	if (parameters)
		(void)db_link_tell(link, "Introduce", parameters);
}

struct pollfd db_link_poll_fd(const struct db_link *link)
{
	return db_client_poll_fd(link->client);
}
