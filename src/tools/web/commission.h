/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Pages that run a commissioning: each has a stream that reports the steps and questions, and calls
 * that answer and hold. The commissioning ends with its stream, when its page falls silent, and by
 * any stop of its drive over this server. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_COMMISSION_H
#define DRIVEBRIDGE_WEB_COMMISSION_H

#include "web/request.h"

/* Most at the same time; each has three connections to the service. */
#define DB_WEB_COMMISSIONS_MAX 2

/* Serves a request, by its kind: the list of steps, a stream that begins a commissioning, or a
 * message to it: the page is there, it watches a motion, or the user's answer. */
void db_web_commission_take(struct db_web_request *request);

/* The drive, or every one with NULL, is being stopped: its commissioning ends. */
void db_web_commission_yield(struct db_web_server *server, const char *drive);

void db_web_commission_tick(struct db_web_server *server, db_time now);

/* Waits for the end of all. */
void db_web_commission_free(struct db_web_server *server);

#endif
