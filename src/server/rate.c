/* SPDX-License-Identifier: Apache-2.0 */
#include "server/rate.h"

#define BURST_PART 10 /* of a second's requests */

db_time db_rate_take(struct db_rate *rate, unsigned per_second, db_time now)
{
	db_time each = DB_NS_PER_S / per_second;
	unsigned burst = per_second > BURST_PART ? per_second / BURST_PART : 1;
	db_time turn = rate->full - (burst - 1) * each;

	if (turn < now)
		turn = now;
	rate->full = (rate->full > turn ? rate->full : turn) + each;
	return turn;
}
