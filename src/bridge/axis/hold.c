/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

bool db_hold_may_begin(const struct db_hold *hold, const struct db_request *motion)
{
	return !motion->counted || !hold->lost || motion->hold_beat != hold->beat;
}

void db_hold_begin(struct db_hold *hold, const struct db_request *motion, db_time arrived)
{
	bool is_held = hold->holder.id != DB_CLIENT_NOBODY;
	struct db_hold next = {
		.holder = motion->client,
		.span = (db_time)motion->hold_ms * DB_NS_PER_MS,
		.number = motion->number,
		/* What began before goes on if the drive does not take the new one. */
		.begun = is_held && hold->begun,
		.beat = motion->hold_beat,
	};

	next.until = arrived + next.span;
	if (is_held && hold->holder.id == motion->client.id &&
	    ((motion->counted && motion->hold_beat == hold->beat) || next.until < hold->until))
		next.until = hold->until;
	*hold = next;
}

bool db_hold_beat(struct db_hold *hold, const struct db_client *client, db_time arrived,
                  db_time now)
{
	if (hold->holder.id == DB_CLIENT_NOBODY || hold->holder.id != client->id ||
	    now >= hold->until)
		return false;
	if (arrived + hold->span > hold->until)
		hold->until = arrived + hold->span;
	return true;
}

void db_hold_desert(struct db_hold *hold, const struct db_client *client, db_time now)
{
	if (hold->holder.id == DB_CLIENT_NOBODY || hold->holder.id != client->id)
		return;
	hold->deserted = true;
	if (hold->until > now)
		hold->until = now;
}

bool db_hold_count(struct db_hold *hold, const struct db_client *client, uint16_t value,
                   db_time arrived, db_time now)
{
	if (value == hold->beat || !db_hold_beat(hold, client, arrived, now))
		return false;
	hold->beat = value;
	return true;
}

void db_hold_end(struct db_hold *hold)
{
	*hold = (struct db_hold){
		.holder.id = DB_CLIENT_NOBODY,
		.lost = hold->lost,
		.beat = hold->beat,
	};
}

db_time db_hold_deadline(const struct db_hold *hold)
{
	return hold->holder.id == DB_CLIENT_NOBODY ? DB_TIME_NEVER : hold->until;
}
