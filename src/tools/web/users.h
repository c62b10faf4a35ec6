/* SPDX-License-Identifier: Apache-2.0 */
/* The user's own password, and the users, as the page changes them. One thread, in addition to the
 * hasher's. */
#ifndef DRIVEBRIDGE_WEB_USERS_H
#define DRIVEBRIDGE_WEB_USERS_H

#include "web/hasher.h"
#include "web/request.h"

/* Answers when the hasher has compared and written. */
void db_web_users_take(struct db_web_request *request);

/* All users without their passwords, as an array; NULL: the request is answered with what is wrong
 * with their file. */
json_t *db_web_users_list(struct db_web_request *request);

/* A change has ended; `request` is NULL if it has been answered or is gone. */
void db_web_users_end(struct db_web_server *server, struct db_web_request *request,
                      const struct db_web_work *work);

#endif
