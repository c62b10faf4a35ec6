/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A token bucket for requests: so many per second, a tenth of them at once. Who comes too early is
 * given the time of its turn instead of a refusal, in the order of asking. Pure: time is passed in.
 */
#ifndef DRIVEBRIDGE_SERVER_RATE_H
#define DRIVEBRIDGE_SERVER_RATE_H

#include "drivebridge/time.h"

/* All zero: a full bucket. */
struct db_rate {
	db_time full; /* when all tokens will be there again */
};

/*
 * Takes a token; returns when it is there: `now`, or the later time at which the asker's turn
 * comes, which is then its own whether or not it uses it. per_second > 0.
 */
db_time db_rate_take(struct db_rate *rate, unsigned per_second, db_time now);

#endif
