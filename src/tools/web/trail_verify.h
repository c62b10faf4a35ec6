/* SPDX-License-Identifier: Apache-2.0 */
/* Verifies the chain of the audit trail for a page. One thread. */
#ifndef DRIVEBRIDGE_WEB_TRAIL_VERIFY_H
#define DRIVEBRIDGE_WEB_TRAIL_VERIFY_H

#include "web/request.h"

/* Answers an admitted request with { checked, broken, more_broken, trail }, as the
 * service's method Audit has them, of the whole trail. */
void db_web_trail_verify(struct db_web_request *request);

#endif
