/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/hold.h"

void db_hold_begin(struct db_hold *hold, const struct db_client *client, uint32_t span_ms,
                   uint32_t order, db_time now)
{
	/* What began before goes on if the drive does not take the new one. */
	bool begun = hold->holder.id != DB_CLIENT_NOBODY && hold->begun;

	*hold = (struct db_hold){
		.holder = *client,
		.span = (db_time)span_ms * DB_NS_PER_MS,
		.order = order,
		.begun = begun,
	};
	hold->until = now + hold->span;
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

void db_hold_end(struct db_hold *hold)
{
	*hold = (struct db_hold){ .holder.id = DB_CLIENT_NOBODY };
}

db_time db_hold_deadline(const struct db_hold *hold)
{
	return hold->holder.id == DB_CLIENT_NOBODY ? DB_TIME_NEVER : hold->until;
}
