/* SPDX-License-Identifier: Apache-2.0 */
/* Logging in and out. One thread, in addition to the hasher's. */
#ifndef DRIVEBRIDGE_WEB_LOGIN_H
#define DRIVEBRIDGE_WEB_LOGIN_H

#include "web/request.h"

/* Answers with the session's user. Sets a cookie if there was none. */
void db_web_login_tell(struct db_web_request *request);

/* Answers when the password has been compared. */
void db_web_login(struct db_web_request *request);
void db_web_logout(struct db_web_request *request);

/* Time until the password of a user may be tried; 0: now, and it counts. `user` is NULL if there is
 * none of this name. */
db_time db_web_login_try(struct db_web_request *request, const char *name,
                         const struct db_user *user);

/* It was right: it does not count. */
void db_web_login_give_back(struct db_web_request *request, const char *name);

/* The user has another password, and his browser stays a known one. */
void db_web_login_keep_device(struct db_web_request *request, const struct db_user *user);

/* The password of a login was compared. */
void db_web_login_end(struct db_web_request *request, const struct db_web_work *work);

/* Logs out users that were removed from the file of users, or have another password or role. */
void db_web_login_review(struct db_web_server *server);

#endif
