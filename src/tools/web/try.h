/* SPDX-License-Identifier: Apache-2.0 */
/* How often a browser may try the password of a user, at a login or to change it. One thread. */
#ifndef DRIVEBRIDGE_WEB_TRY_H
#define DRIVEBRIDGE_WEB_TRY_H

#include "web/request.h"

/* Time until the password of a user may be tried; 0: now, and it counts. `user` is NULL if there is
 * none of this name. */
db_time db_web_try_password(struct db_web_request *request, const char *name,
                            const struct db_user *user);

/* It was right: it does not count. */
void db_web_try_was_right(struct db_web_request *request, const char *name);

/* The user has another password, and his browser stays a known one. */
void db_web_try_keep_device(struct db_web_request *request, const struct db_user *user);

#endif
