/* SPDX-License-Identifier: Apache-2.0 */
/* Calls that a request makes of the service, and is answered with. One thread. */
#ifndef DRIVEBRIDGE_WEB_CALL_H
#define DRIVEBRIDGE_WEB_CALL_H

#include "web/link.h"
#include "web/request.h"

/*
 * Sends the method of its route with its parameters over the link (NULL: the service is away), and answers the request
 * when the service has answered, or when `within` has passed. What acts and fails is logged.
 */
void db_web_call(struct db_web_request *request, struct db_web_link *link, db_time within);

/* Logs what a request does, with all of its parameters. */
void db_web_log_action(const struct db_web_request *request, const char *what,
                       const json_t *parameters);

#endif
