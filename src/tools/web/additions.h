/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a page's streams have in addition to the answers of the service, computed as drivebridgectl
 * computes it (capture/, setup/):
 *
 *	Trace      of each record `words` is WHO: WORDS with the time that an answer took, and
 *	           `bytes` stands in place of `data`, as in a line of drivebridgectl. With `pcapng`
 *	           in the call each frame on CAN has its block of such a file, and the first answer
 *	           has the file's head, in base64.
 *	Scan       `configuration`: sections for the drives that were found until then.
 *	Subscribe  with `trigger` in the call ("feeder.position>10000"): samples that meet the
 *	           condition, after one that did not, have `triggers`.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_WEB_ADDITIONS_H
#define DRIVEBRIDGE_WEB_ADDITIONS_H

#include "web/request.h"

struct db_web_additions;

/* Takes out of the parameters what is not for the service. NULL: the stream has none, or, with
 * `problem`, the call is wrong. Freed with db_web_additions_free(), NULL is allowed. */
struct db_web_additions *db_web_additions_new(const struct db_web_request *request,
                                              const char **problem);
void db_web_additions_free(struct db_web_additions *additions);

/* The drive whose registers are needed before the call, NULL: none; and its registers. False with
 * what is wrong. */
const char *db_web_additions_drive(const struct db_web_additions *additions);
bool db_web_additions_take_registers(struct db_web_additions *additions, const json_t *registers,
                                     char *problem, size_t size);

/* Completes an answer; each once, in their order. */
void db_web_additions_complete(struct db_web_additions *additions, json_t *answer);

#endif
