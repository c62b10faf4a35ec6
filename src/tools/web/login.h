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

/* Answers with the sessions of the same user, after ending some of them where that is asked for. */
void db_web_login_own(struct db_web_request *request);

/* The password of a login was compared. */
void db_web_login_end(struct db_web_request *request, const struct db_web_work *work);

/* Logs out users that were removed from the file of users, or have another password or role. */
void db_web_login_review(struct db_web_server *server);

#endif
