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

/*
 * Makes a call over a connection of its own, closed with the request: for what takes the service
 * long, so that no other call waits for it. Takes `parameters` over. `answer` answers the request
 * from what the service has answered; errors are answered here, and Busy when LINKS_MAX are open.
 */
void db_web_call_aside(struct db_web_request *request, const char *method, json_t *parameters,
                       db_time within,
                       void (*answer)(struct db_web_request *request, json_t *parameters));

/* Logs an action of a request with all its parameters. */
void db_web_log_action(const struct db_web_request *request, const char *what,
                       const json_t *parameters);

#endif
