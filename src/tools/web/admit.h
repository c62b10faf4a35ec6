/* SPDX-License-Identifier: Apache-2.0 */
/* Who sent a request, and whether that user may send it: by its headers alone. One thread. */
#ifndef DRIVEBRIDGE_WEB_ADMIT_H
#define DRIVEBRIDGE_WEB_ADMIT_H

#include "web/request.h"

/* Fills in address, user, session, role and tab of a request whose route is known, and refuses what
 * is not allowed. */
void db_web_admit(struct db_web_request *request);

#endif
