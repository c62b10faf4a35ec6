/* SPDX-License-Identifier: Apache-2.0 */
/* Calls to the service on behalf of a request, which gets the answer. One thread. */
#ifndef DRIVEBRIDGE_WEB_CALL_H
#define DRIVEBRIDGE_WEB_CALL_H

#include "client/link.h"
#include "web/request.h"

/*
 * Sends the method of its route with its parameters over the link (NULL: the service is away), and
 * answers the request when the service has answered, or when `within` has passed. Failures of
 * acting calls are logged.
 */
void db_web_call(struct db_web_request *request, struct db_link *link, db_time within);

/* Logs an action of a request with all its parameters. */
void db_web_log_action(const struct db_web_request *request, const char *what,
                       const json_t *parameters);

#endif
