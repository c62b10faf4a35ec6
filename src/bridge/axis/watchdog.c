/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include "drivebridge/commander.h"

#include <string.h>

bool db_heartbeat_write(struct db_heartbeat *heartbeat, const uint8_t writer[16], uint16_t value)
{
	bool same = db_client_same(heartbeat->writer, writer);
	bool beats = same && value != heartbeat->value;

	memcpy(heartbeat->writer, writer, sizeof(heartbeat->writer));
	heartbeat->value = value;
	return beats;
}

void db_watchdog_init(struct db_watchdog *watchdog, uint32_t timeout_ms, enum db_watchdog_feed feed)
{
	*watchdog = (struct db_watchdog){ .timeout_ms = timeout_ms, .feed = feed };
}

/* Never backwards: an older request may be served after a newer one. */
static void note_life(struct db_watchdog *watchdog, db_time now)
{
	if (now > watchdog->fed)
		watchdog->fed = now;
}

void db_watchdog_set(struct db_watchdog *watchdog, uint32_t timeout_ms, db_time now)
{
	if (timeout_ms != watchdog->timeout_ms)
		note_life(watchdog, now);
	watchdog->timeout_ms = timeout_ms;
}

void db_watchdog_arm(struct db_watchdog *watchdog, db_time now)
{
	if (!watchdog->armed) {
		watchdog->fed = now;
		memset(watchdog->commanders, 0, sizeof(watchdog->commanders));
		watchdog->was_commanded_by_plc = watchdog->session_has_left = false;
	} else if (watchdog->feed <= DB_FEED_WRITES) {
		note_life(watchdog, now);
	}
	watchdog->armed = true;
}

static struct db_watchdog_commander *find_connection(struct db_watchdog *watchdog, uint32_t client)
{
	for (size_t i = 0; client != DB_CLIENT_NOBODY && i < DB_WATCHDOG_COMMANDERS; i++) {
		if (watchdog->commanders[i].client == client)
			return &watchdog->commanders[i];
	}
	return NULL;
}

bool db_watchdog_is_commanded_by(const struct db_watchdog *watchdog, const struct db_client *client)
{
	for (size_t i = 0; i < DB_WATCHDOG_COMMANDERS; i++) {
		const struct db_watchdog_commander *known = &watchdog->commanders[i];

		if (known->taken && (!client || db_client_same(known->address, client->address)))
			return true;
	}
	return false;
}

void db_watchdog_commanded(struct db_watchdog *watchdog, const struct db_client *client)
{
	struct db_watchdog_commander *place = &watchdog->commanders[watchdog->next_commander];

	if (client->id == DB_CLIENT_NOBODY || find_connection(watchdog, client->id))
		return;
	watchdog->was_commanded_by_plc |= !db_client_is_session(client->id);
	*place = (struct db_watchdog_commander){ .client = client->id, .taken = true };
	memcpy(place->address, client->address, sizeof(place->address));
	watchdog->next_commander = (watchdog->next_commander + 1) % DB_WATCHDOG_COMMANDERS;
}

void db_watchdog_forget(struct db_watchdog *watchdog, uint32_t client)
{
	struct db_watchdog_commander *gone = find_connection(watchdog, client);

	if (!gone)
		return;
	gone->client = DB_CLIENT_NOBODY;
	watchdog->session_has_left |= db_client_is_session(client);
}

bool db_watchdog_is_deserted(const struct db_watchdog *watchdog)
{
	for (size_t i = 0; i < DB_WATCHDOG_COMMANDERS; i++) {
		if (watchdog->commanders[i].client != DB_CLIENT_NOBODY)
			return false;
	}
	return watchdog->session_has_left && !watchdog->was_commanded_by_plc;
}

bool db_watchdog_feed(struct db_watchdog *watchdog, enum db_watchdog_feed by,
                      const struct db_client *client, db_time now)
{
	enum db_watchdog_feed value = DB_FEED_REQUESTS; /* of this feed from this client */

	if (by == DB_FEED_HEARTBEAT && watchdog->feed == DB_FEED_HEARTBEAT)
		value = by;
	else if (by == DB_FEED_REQUESTS)
		value = find_connection(watchdog, client->id) ? DB_FEED_COMMANDERS : by;
	else if (db_watchdog_is_commanded_by(watchdog, client))
		value = DB_FEED_WRITES;
	if (value < watchdog->feed)
		return false;
	note_life(watchdog, now);
	return true;
}

db_time db_watchdog_deadline(const struct db_watchdog *watchdog)
{
	if (!watchdog->armed || watchdog->latched || watchdog->timeout_ms == 0)
		return DB_TIME_NEVER;
	return watchdog->fed + (db_time)watchdog->timeout_ms * DB_NS_PER_MS;
}

bool db_watchdog_trip(struct db_watchdog *watchdog, db_time now)
{
	if (now < db_watchdog_deadline(watchdog))
		return false;
	watchdog->armed = false;
	watchdog->latched = true;
	watchdog->latched_at = now;
	watchdog->trips++;
	return true;
}

void db_watchdog_reset(struct db_watchdog *watchdog)
{
	watchdog->latched = false;
	watchdog->armed = false;
}

uint32_t db_watchdog_remaining_ms(const struct db_watchdog *watchdog, db_time now)
{
	db_time deadline = db_watchdog_deadline(watchdog);

	if (deadline == DB_TIME_NEVER || deadline <= now)
		return 0;
	/* Rounded up: 0 means that there is nothing to wait for. */
	return (uint32_t)((deadline - now + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
}
