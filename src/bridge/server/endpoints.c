/* SPDX-License-Identifier: Apache-2.0 */
#include "server/endpoints.h"

#include "drivebridge/loop_clock.h"
#include "server/listener.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

struct db_endpoints {
	struct db_endpoints_host host;
	const struct db_modbus_config *config; /* null until one was applied */
	struct db_endpoint **all;              /* in the order of the configuration */
	size_t count;
};

/* What becomes of one endpoint. */
struct plan {
	struct db_endpoint *endpoint;
	bool made;    /* it is new, and owned by the change until that is applied */
	int listener; /* in the epoll set already; -1: unchanged */
	bool opens;   /* its secure socket is another one than before */
};

struct db_endpoints_change {
	const struct db_modbus_config *config;
	struct plan *plans;
	size_t count;
	struct db_endpoint **all; /* room for them */
};

struct db_endpoints *db_endpoints_new(const struct db_endpoints_host *host)
{
	struct db_endpoints *endpoints = calloc(1, sizeof(*endpoints));

	if (endpoints)
		endpoints->host = *host;
	return endpoints;
}

static void free_endpoint(struct db_endpoint *endpoint)
{
	if (!endpoint)
		return;
	db_secure_free(endpoint->secure);
	if (endpoint->listener >= 0)
		close(endpoint->listener);
	free(endpoint);
}

void db_endpoints_free(struct db_endpoints *endpoints)
{
	if (!endpoints)
		return;
	for (size_t i = 0; i < endpoints->count; i++)
		free_endpoint(endpoints->all[i]);
	free(endpoints->all);
	free(endpoints);
}

struct db_endpoint *db_endpoints_find(const struct db_endpoints *endpoints, uint32_t number)
{
	for (size_t i = 0; i < endpoints->count; i++) {
		if (endpoints->all[i]->number == number)
			return endpoints->all[i];
	}
	return NULL;
}

struct db_endpoint *db_endpoints_of_event(const struct db_endpoints *endpoints, const void *data)
{
	for (size_t i = 0; i < endpoints->count; i++) {
		if (endpoints->all[i] == data)
			return endpoints->all[i];
	}
	return NULL;
}

void db_endpoints_set_accepting(struct db_endpoints *endpoints, bool accepting)
{
	for (size_t i = 0; i < endpoints->count; i++) {
		struct epoll_event event = { .events = accepting ? EPOLLIN : 0,
			                     .data.ptr = endpoints->all[i] };

		(void)epoll_ctl(endpoints->host.epoll, EPOLL_CTL_MOD, endpoints->all[i]->listener,
		                &event);
	}
}

/* --- the secure sockets ----------------------------------------------------------------------- */

static const char *secure_path(const struct db_modbus_config *config, uint32_t number)
{
	struct db_endpoint_config at;

	if (!config || !db_modbus_endpoint_find(config, number, &at) || !at.secure_socket)
		return DB_NO_SOCKET;
	return at.secure_socket;
}

bool db_endpoints_have_secure(const struct db_modbus_config *config, uint32_t number)
{
	return strcmp(secure_path(config, number), DB_NO_SOCKET) != 0;
}

static void admit_secure(void *context, int fd, const struct db_secure_client *client)
{
	struct db_endpoint *endpoint = context;
	const struct db_endpoints_host *host = &endpoint->endpoints->host;

	host->admit_secure(host->context, endpoint, fd, client);
}

/* Clients without certificates must not be kept out by this: an error is logged, and nothing
 * else. */
static void open_secure(struct db_endpoint *endpoint)
{
	const struct db_endpoints *endpoints = endpoint->endpoints;
	const char *path = secure_path(endpoints->config, endpoint->number);
	const char *name = db_modbus_endpoint_name(endpoints->config, endpoint->number);
	const char *why;
	int error;

	if (strcmp(path, DB_NO_SOCKET) == 0)
		return;
	error = db_secure_new(endpoints->host.loop, path, endpoints->host.log, admit_secure,
	                      endpoint, &endpoint->secure, &why);
	if (error >= 0)
		return;
	db_log(endpoints->host.log, db_loop_now(endpoints->host.loop), DB_EVENT_SECURE_FAILED, NULL,
	       "no secure socket for drivebridge-tls: %s: %s; correct secure-socket in the "
	       "section %s%s, or set it to off",
	       path, why ? why : strerror(-error), name[0] ? "endpoint " : "modbus", name);
}

/* The earlier of two dates, of which 0 is none. */
static int64_t first_of(int64_t a, int64_t b)
{
	return a == 0 || (b != 0 && b < a) ? b : a;
}

bool db_endpoints_secure_status(const struct db_endpoints *endpoints,
                                struct db_secure_status *status)
{
	bool any = false;

	*status = (struct db_secure_status){ 0 };
	for (size_t i = 0; i < endpoints->count; i++) {
		struct db_secure_status one;

		if (!db_secure_read_status(endpoints->all[i]->secure, &one))
			continue;
		any = true;
		status->expires = first_of(status->expires, one.expires);
		status->crl_expires = first_of(status->crl_expires, one.crl_expires);
		status->client_expires = first_of(status->client_expires, one.client_expires);
		status->clients += one.clients;
		status->greetings += one.greetings;
		status->accepted += one.accepted;
		status->refused += one.refused;
		status->displaced += one.displaced;
	}
	return any;
}

/* --- another configuration -------------------------------------------------------------------- */

static int plan_endpoint(struct db_endpoints *endpoints, const struct db_endpoint_config *config,
                         struct plan *plan)
{
	struct epoll_event event = { .events = 0 };
	struct db_endpoint_config present = { .listen = NULL };
	int listeners[DB_ENDPOINTS_MAX + 1];
	size_t count = 0;

	plan->listener = -1;
	plan->endpoint = db_endpoints_find(endpoints, config->number);
	if (!plan->endpoint) {
		plan->endpoint = calloc(1, sizeof(*plan->endpoint));
		if (!plan->endpoint)
			return -ENOMEM;
		plan->made = true;
		plan->endpoint->endpoints = endpoints;
		plan->endpoint->number = config->number;
		plan->endpoint->listener = -1;
	}
	/* Where it listens now, it goes on. */
	if (endpoints->config &&
	    db_modbus_endpoint_find(endpoints->config, config->number, &present) &&
	    present.listen && strcmp(present.listen, config->listen) == 0)
		return 0;
	for (size_t i = 0; i < endpoints->count && count < DB_ENDPOINTS_MAX + 1; i++)
		listeners[count++] = endpoints->all[i]->listener;
	/* Of the list, `count` are read. */
	/* cppcheck-suppress uninitvar */
	plan->listener = db_listener_open(listeners, count, config->listen);
	/* The plan has the endpoint, and frees it; gcc's analyzer does not see that. */
	if (plan->listener < 0)
		return plan->listener;
	event.data.ptr = plan->endpoint;
	if (epoll_ctl(endpoints->host.epoll, EPOLL_CTL_ADD, plan->listener, &event) < 0)
		return -errno;
	return 0;
}

int db_endpoints_prepare(struct db_endpoints *endpoints, const struct db_modbus_config *config,
                         struct db_endpoints_change **change, const char **where)
{
	struct db_endpoints_change *made = calloc(1, sizeof(*made));
	size_t count = db_modbus_endpoint_count(config);
	int error = made ? 0 : -ENOMEM;

	*where = NULL;
	if (made) {
		made->config = config;
		made->plans = calloc(count, sizeof(made->plans[0]));
		made->all = calloc(count, sizeof(struct db_endpoint *));
		error = made->plans && made->all ? 0 : -ENOMEM;
	}
	while (error == 0 && made->count < count) {
		const struct db_endpoint_config at = db_modbus_endpoint_at(config, made->count);

		error = plan_endpoint(endpoints, &at, &made->plans[made->count++]);
		if (error < 0)
			*where = at.listen;
	}
	if (error < 0) {
		db_endpoints_change_free(made);
		return error;
	}
	*change = made;
	return 0;
}

void db_endpoints_change_free(struct db_endpoints_change *change)
{
	if (!change)
		return;
	for (size_t i = 0; i < change->count; i++) {
		struct plan *plan = &change->plans[i];

		if (plan->listener >= 0)
			close(plan->listener);
		if (plan->made)
			free_endpoint(plan->endpoint);
	}
	free(change->all);
	free(change->plans);
	free(change);
}

void db_endpoints_apply(struct db_endpoints *endpoints, struct db_endpoints_change *change)
{
	const struct db_modbus_config *before = endpoints->config;
	struct db_endpoint **old = endpoints->all;
	size_t old_count = endpoints->count;

	for (size_t i = 0; i < change->count; i++) {
		struct plan *plan = &change->plans[i];
		struct db_endpoint *endpoint = plan->endpoint;

		/* Clients that connected to the old address in time are accepted. */
		if (plan->listener >= 0 && endpoint->listener >= 0) {
			endpoints->host.accept(endpoints->host.context, endpoint,
			                       DB_LISTENER_BACKLOG + 1);
			close(endpoint->listener);
		}
		if (plan->listener >= 0)
			endpoint->listener = plan->listener;
		/* A path may pass from one endpoint to another: all are closed before any is
		 * opened. */
		plan->opens = strcmp(secure_path(before, endpoint->number),
		                     secure_path(change->config, endpoint->number)) != 0;
		if (plan->opens) {
			db_secure_free(endpoint->secure);
			endpoint->secure = NULL;
		}
		change->all[i] = endpoint;
	}
	for (size_t i = 0; i < old_count; i++) {
		bool stays = false;

		for (size_t j = 0; j < change->count; j++)
			stays = stays || change->all[j] == old[i];
		if (!stays)
			free_endpoint(old[i]);
	}
	endpoints->config = change->config;
	endpoints->all = change->all;
	endpoints->count = change->count;
	for (size_t i = 0; i < change->count; i++) {
		if (change->plans[i].opens)
			open_secure(endpoints->all[i]);
	}
	db_endpoints_set_accepting(endpoints, true);
	free(old);
	free(change->plans);
	free(change);
}
