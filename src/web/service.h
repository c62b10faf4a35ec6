/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The connection to drivebridged: three that everybody shares, one for calls that only read, one for stops and one for its
 * clock, made again each second while the service is away; and how many more there are. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_SERVICE_H
#define DRIVEBRIDGE_WEB_SERVICE_H

#include "web/link.h"
#include "web/state.h"
#include "web/tokens.h"

/*
 * The service has 64 sessions for all its tools. Beside the three, and the overview's: streams of values, events, traces and
 * scans; tabs that act; stops (DB_WEB_STOPS_MAX).
 */
#define DB_WEB_STREAM_LINKS 12
#define DB_WEB_TABS_MAX 5

struct db_web_service;

/* Called when it has come or gone, and when it has other drives. */
typedef void db_web_service_changed_fn(void *data);

/* Called with each token of its clock. */
typedef void db_web_service_token_fn(void *data, const char *token);

/* NULL without memory. Freed with db_web_service_free(), NULL is allowed. */
struct db_web_service *db_web_service_new(struct db_web_server *server,
                                          db_web_service_changed_fn *changed,
                                          db_web_service_token_fn *give_token, void *data);
void db_web_service_free(struct db_web_service *service);

void db_web_service_tick(struct db_web_service *service, db_time now);

bool db_web_service_is_up(const struct db_web_service *service);

/* The answer of Describe; NULL while it is away. Stays the service's. */
json_t *db_web_service_description(const struct db_web_service *service);

/* Asks what it has again; `changed` tells when that differs. */
void db_web_service_look_again(struct db_web_service *service);

/* Whether a drive with this value of axis_state moves, by the names that the service gives to the values. */
bool db_web_service_is_moving(const struct db_web_service *service, const json_t *axis_state);

/* NULL while it is away. */
struct db_web_link *db_web_service_reader(const struct db_web_service *service);

/* The tokens of the service's clock that have come, as long as somebody needs them. */
const struct db_web_tokens *db_web_service_tokens(const struct db_web_service *service);

/* Tells a stop for the user without hearing of its end, where there is no connection more to be had. -1 while it is away.
 * Takes `parameters` over. */
int db_web_service_tell_stop(const struct db_web_service *service, const char *user,
                             const char *method, json_t *parameters);

/* One more, closed by who has it. NULL with an error. */
struct db_web_link *db_web_service_open(struct db_web_service *service, db_web_link_lost_fn *lost,
                                        void *data, struct db_client_error *error);

#endif
