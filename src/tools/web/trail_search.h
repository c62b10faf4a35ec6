/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Searches the audit trail for a page, from the newest records back. The service tells records
 * oldest first, so a search reads windows, each one older and larger than the one before, and keeps
 * the latest records of each. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_TRAIL_SEARCH_H
#define DRIVEBRIDGE_WEB_TRAIL_SEARCH_H

#include "web/request.h"

/* Most records of an answer. */
#define DB_WEB_TRAIL_PAGE 100

/*
 * Answers a request { before, and a filter (trail_filter.h) } with { records, before, over, trail
 * }: wanted records with numbers below `before` (0 or missing: all), newest first, each with
 * `line`, `through` and `failed`. The answer's `before` is for the next request, which goes on
 * there; it may have few records, or none, because a search takes a limited time. over: there are
 * no older ones. trail: as the service's method Audit has it.
 */
void db_web_trail_search(struct db_web_request *request);

#endif
