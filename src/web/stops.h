/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stops, each over a connection of its own to drivebridged: it takes the next call of a connection when the one before is
 * answered, and a stop is answered when the drive has confirmed it, which one that is silent does not. So none waits
 * behind another. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_STOPS_H
#define DRIVEBRIDGE_WEB_STOPS_H

#include "web/request.h"

/* Those that are not confirmed at the same time, of all pages. One more takes the place of the oldest, with which
 * the service goes on by itself. */
#define DB_WEB_STOPS_MAX 8

struct db_web_stops;

/* NULL without memory. Freed with db_web_stops_free(), NULL is allowed. */
struct db_web_stops *db_web_stops_new(struct db_web_server *server);
void db_web_stops_free(struct db_web_stops *stops);

/* Tells it for the user, and answers the request. One that its page sends again, because it had no answer yet, takes
 * the answer of the one before, which is answered with pending: the service is not told twice what it is at. False
 * then. */
bool db_web_stops_call(struct db_web_stops *stops, struct db_web_request *request, db_time within);

/* Stops one drive. `answer`: as of db_web_link_send(). -1 when it will not come: the stop was told without, or the service
 * is away. */
int db_web_stops_drive(struct db_web_stops *stops, const char *user, const char *drive,
                       db_client_answer_fn *answer, void *data);

/* Who was to be told of answers is no more. */
void db_web_stops_forget(struct db_web_stops *stops, const void *data);

void db_web_stops_tick(struct db_web_stops *stops);

#endif
