/* SPDX-License-Identifier: Apache-2.0 */
/* Who sent a request, and whether that user may send it. One thread. */
#ifndef DRIVEBRIDGE_WEB_ADMIT_H
#define DRIVEBRIDGE_WEB_ADMIT_H

#include "web/request.h"

/* What a browser without a login may. */
struct db_grant db_web_grant_of_nobody(const struct db_web_config *config);

/* Fills in address, user, session, rights and tab of a request whose route is known, by its
 * headers alone, and refuses what is not allowed. */
void db_web_admit(struct db_web_request *request);

/* To be called when an admitted request is whole, which may be long behind its headers: its session
 * may have ended by now. Takes the user's present rights, and refuses what these do not allow. */
void db_web_admit_again(struct db_web_request *request);

/* Refuses what the user may not do by the parameters of an admitted request: a command of more than
 * his role, a drive that is not his. */
void db_web_admit_content(struct db_web_request *request);

#endif
