/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state of all drives for every page that shows it: one stream of the service, each text
 * written once. A new stream gets everything, then the changes; a stream that was too slow gets the
 * newest values of all drives instead of the missed changes. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_OVERVIEW_H
#define DRIVEBRIDGE_WEB_OVERVIEW_H

#include "web/request.h"

struct db_web_overview;

/* NULL without memory. Freed with db_web_overview_free(), after all requests. NULL is allowed. */
struct db_web_overview *db_web_overview_new(struct db_web_server *server);
void db_web_overview_free(struct db_web_overview *overview);

/* Answers with the stream. */
void db_web_overview_begin(struct db_web_request *request);

/* The service was connected, lost, or has another configuration. */
void db_web_overview_changed(struct db_web_overview *overview);

/* The service's clock has sent this token. */
void db_web_overview_take_token(struct db_web_server *server, const char *token);

void db_web_overview_tick(struct db_web_overview *overview, db_time now);

#endif
