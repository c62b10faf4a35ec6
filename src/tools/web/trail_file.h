/* SPDX-License-Identifier: Apache-2.0 */
/* The audit trail as a file for a browser, which gets it page by page as it takes it. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_TRAIL_FILE_H
#define DRIVEBRIDGE_WEB_TRAIL_FILE_H

#include "web/request.h"

/* Downloads at the same time. */
#define DB_WEB_TRAIL_FILES 4

/* Answers with records, oldest first: as JSON objects, one a line, or in the Common Event Format,
 * as the route's name says. The address has a filter (trail_filter.h) as its query. A file that
 * cannot be read to its end, or whose user's login ends, is broken off. */
void db_web_trail_file(struct db_web_request *request);

#endif
