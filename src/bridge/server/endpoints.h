/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The TCP endpoints of a server: the listening socket of each, its secure socket, and how many
 * clients it has. Network thread only.
 */
#ifndef DRIVEBRIDGE_SERVER_ENDPOINTS_H
#define DRIVEBRIDGE_SERVER_ENDPOINTS_H

#include "drivebridge/config.h"
#include "drivebridge/log.h"
#include "server/secure.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <systemd/sd-event.h>

struct db_endpoints;
struct db_endpoints_change;

struct db_endpoint {
	struct db_endpoints *endpoints;
	uint32_t number; /* see db_endpoint_number() */
	int listener;
	struct db_secure *secure; /* null: there is no secure socket */
	size_t clients;           /* connected now; counted by the server */
	size_t readers;           /* those of them that may only read */
};

/* What endpoints need of the server that they belong to, which outlives them. */
struct db_endpoints_host {
	sd_event *loop;
	const struct db_log_source *log;
	int epoll; /* gets each listening socket, with its endpoint as the event's data.ptr */
	/* A client of drivebridge-tls, whose descriptor is taken over. */
	void (*admit_secure)(void *context, struct db_endpoint *endpoint, int fd,
	                     const struct db_secure_client *client);
	/* An endpoint listens elsewhere from now on, or no longer: clients that connected in time
	 * are to be accepted, `most` at most. */
	void (*accept)(void *context, const struct db_endpoint *endpoint, int most);
	void *context;
};

/* Null when out of memory. The host is copied. */
struct db_endpoints *db_endpoints_new(const struct db_endpoints_host *host);
void db_endpoints_free(struct db_endpoints *endpoints); /* null is fine */

/*
 * The endpoints of another configuration, in two steps as db_server_prepare(). 0 or a negative
 * errno; *where is then the address that cannot be listened on, or null when it was something else.
 */
int db_endpoints_prepare(struct db_endpoints *endpoints, const struct db_modbus_config *config,
                         struct db_endpoints_change **change, const char **where);
void db_endpoints_change_free(struct db_endpoints_change *change); /* null is fine */

/* Clients of endpoints that the configuration does not have any more must be gone. */
void db_endpoints_apply(struct db_endpoints *endpoints, struct db_endpoints_change *change);

/* Null: there is none. */
struct db_endpoint *db_endpoints_find(const struct db_endpoints *endpoints, uint32_t number);

/* The endpoint that is the data of an event; null: it is of something else. */
struct db_endpoint *db_endpoints_of_event(const struct db_endpoints *endpoints, const void *data);

/* Whether new connections are to be reported. */
void db_endpoints_set_accepting(struct db_endpoints *endpoints, bool accepting);

/* True if clients with certificates are taken at this endpoint. */
bool db_endpoints_have_secure(const struct db_modbus_config *config, uint32_t number);

/* How the programs that hand clients over are, in one: the first dates and the sums. False: none is
 * connected. */
bool db_endpoints_secure_status(const struct db_endpoints *endpoints,
                                struct db_secure_status *status);

#endif
