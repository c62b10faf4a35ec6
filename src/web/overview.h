/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What all drives do, for everybody who looks: one stream of the service, each text made once. Who looks is told what
 * there is, then what changes; who was too slow gets the newest values of all drives instead of what he missed. One
 * thread.
 */
#ifndef DRIVEBRIDGE_WEB_OVERVIEW_H
#define DRIVEBRIDGE_WEB_OVERVIEW_H

#include "web/request.h"

struct db_web_overview;

/* NULL without memory. Freed with db_web_overview_free(), behind all requests. NULL is allowed. */
struct db_web_overview *db_web_overview_new(struct db_web_server *server);
void db_web_overview_free(struct db_web_overview *overview);

/* Answers with the stream. */
void db_web_overview_begin(struct db_web_overview *overview, struct db_web_request *request);

/* The service has come, gone, or changed. */
void db_web_overview_changed(struct db_web_overview *overview);

/* The service's clock has given this token. */
void db_web_overview_take_token(struct db_web_overview *overview, const char *token);

void db_web_overview_tick(struct db_web_overview *overview, db_time now);

#endif
