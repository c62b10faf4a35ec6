/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The connections to drivebridged: two shared ones, for calls that only read (client/plant.h) and
 * for its clock; and further ones on request. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_SERVICE_H
#define DRIVEBRIDGE_WEB_SERVICE_H

#include "client/plant.h"
#include "web/state.h"
#include "web/tokens.h"

/*
 * The service has 64 sessions for all its tools. In addition to these and the overview's there
 * are: streams of values, events, traces and scans; acting tabs; stops (stops.h).
 */
#define DB_WEB_STREAM_LINKS 12
#define DB_WEB_TABS_MAX 5

/* Called when the service is connected or lost, and when it has other drives. */
typedef void db_web_service_changed_fn(struct db_web_server *server);

/* Called with each token of its clock. */
typedef void db_web_service_token_fn(struct db_web_server *server, const char *token);

/* The other files of this room read it, and add notes to the audit trail over its plant; only
 * overview.c has its plant read again, and `changed` is called when that differs. */
struct db_web_service {
	struct db_web_server *server;
	db_web_service_changed_fn *changed;
	db_web_service_token_fn *give_token;
	struct db_plant *plant;
	struct db_link *clock;       /* NULL while the service is away */
	json_t *description;         /* the answer of Describe; NULL while the service is away */
	json_t *states;              /* the codes of axis_state */
	struct db_web_tokens tokens; /* received from its clock, while a page needs them */
	bool asking;                 /* a token was asked for */
	bool has_audit;              /* it takes what is for its audit trail */
};

/* NULL without memory. Freed with db_web_service_free(), NULL is allowed. */
struct db_web_service *db_web_service_new(struct db_web_server *server,
                                          db_web_service_changed_fn *changed,
                                          db_web_service_token_fn *give_token);
void db_web_service_free(struct db_web_service *service);

void db_web_service_tick(struct db_web_service *service, db_time now);

bool db_web_service_is_up(const struct db_web_service *service);

/* The commands that stop a drive, which pages send past everything that waits: a new array of their
 * names. Without a connection those that were known last. */
json_t *db_web_service_stops(const struct db_web_service *service);

/* True if a drive with this value of axis_state moves, by the names that the service gives to the
 * values. */
bool db_web_service_is_moving(const struct db_web_service *service, const json_t *axis_state);

/* NULL while it is away. */
struct db_link *db_web_service_reader(const struct db_web_service *service);

/* A further connection, closed by the caller. NULL with an error. */
struct db_link *db_web_service_open(struct db_web_service *service, db_link_lost_fn *lost,
                                    void *data, struct db_client_error *error);

#endif
