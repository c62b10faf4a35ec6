/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include <stdbool.h>

/* Limit of what a class is owed or owes: after a long exchange the others catch up, but not for
 * ever. */
#define OWED_MAX (1000 * DB_NS_PER_MS)

static db_time bounded(db_time owed)
{
	return owed > OWED_MAX ? OWED_MAX : owed < -OWED_MAX ? -OWED_MAX : owed;
}

enum db_share shares_choose(struct shares *shares, unsigned waiting)
{
	unsigned fresh = waiting & ~shares->waiting;
	enum db_share chosen = DB_SHARE_NONE;
	db_time most = -OWED_MAX;

	/* Nearly always the same class as before, and no other one has got anything to send since
	 * that it cannot claim now. */
	if (waiting == shares->waiting && (waiting & (waiting - 1)) == 0)
		return (enum db_share)__builtin_ctz(waiting);
	for (unsigned i = 0; i < DB_SHARE_COUNT; i++) {
		/* Time that it did not claim then is not owed to it now. */
		if (!(waiting & DB_SHARE_BIT(i)) && shares->owed[i] > 0)
			shares->owed[i] = 0;
		else if (waiting & DB_SHARE_BIT(i) && shares->owed[i] > most)
			most = shares->owed[i];
	}
	for (unsigned i = DB_SHARE_COUNT; i-- > 0;) {
		bool first = fresh & DB_SHARE_BIT(i) && shares->owed[i] >= 0;

		if (waiting & DB_SHARE_BIT(i) && (first || shares->owed[i] >= most))
			chosen = (enum db_share)i;
	}
	shares->waiting = waiting;
	return chosen;
}

void shares_charge(struct shares *shares, enum db_share share, db_time cost)
{
	unsigned claiming;
	bool alone;
	db_time weights;

	if (share == DB_SHARE_NONE)
		return;
	claiming = shares->waiting | DB_SHARE_BIT(share);
	alone = claiming == DB_SHARE_BIT(share);
	weights = alone ? db_share_weight(share) : db_share_weights(claiming);
	for (unsigned i = 0; i < DB_SHARE_COUNT; i++) {
		db_time *owed = &shares->owed[i];

		if (i != share && shares->waiting & DB_SHARE_BIT(i)) {
			*owed = bounded(*owed + cost * db_share_weight(i) / weights);
		} else if (i != share && *owed < 0) {
			/* A class that had more than its part pays that back while others send, at
			 * no one's expense. */
			*owed += cost * db_share_weight(i) / (weights + db_share_weight(i));
			*owed = *owed > 0 ? 0 : *owed;
		}
	}
	/* While no other class wants the wire, nothing is owed to any. */
	if (alone)
		shares->owed[share] = 0;
	else
		shares->owed[share] = bounded(shares->owed[share] - cost +
		                              cost * db_share_weight(share) / weights);
}
