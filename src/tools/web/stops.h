/* SPDX-License-Identifier: Apache-2.0 */
/* Stops of pages, which go past the server's lanes (client/stops.h), and what is answered to their
 * browsers. One thread. */
#ifndef DRIVEBRIDGE_WEB_STOPS_H
#define DRIVEBRIDGE_WEB_STOPS_H

#include "client/stops.h"
#include "web/request.h"

/* Most unconfirmed stops at the same time, of all pages. */
#define DB_WEB_STOPS_MAX 8

/* Sends it for the user, and answers the request. If its page repeats it because it had no answer
 * yet, the new request waits for the answer to the first call, and the former request is answered
 * with pending: the service does not get the same stop twice. False then. */
bool db_web_stops_call(struct db_web_request *request, db_time within);

/* Sends what stops one drive (Run, with its command stop) or a list of at least one (Stop); takes
 * the parameters over. `answer`: as of db_stops_send(). False when there will be no answer. */
bool db_web_stops_send(struct db_web_server *server, const struct db_web_caller *caller,
                       const char *method, json_t *parameters, db_client_answer_fn *answer,
                       void *data);

#endif
