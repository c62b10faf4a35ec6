/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/control.h"

#include <string.h>

void db_control_init(struct db_control *control, bool enabled, uint32_t timeout_ms)
{
	*control = (struct db_control){ .enabled = enabled };
	control->timeout = (db_time)timeout_ms * DB_NS_PER_MS;
}

void db_control_change(struct db_control *control, bool enabled, uint32_t timeout_ms)
{
	struct db_control before = *control;

	db_control_init(control, enabled, timeout_ms);
	if (!enabled)
		return;
	control->holder = before.holder;
	control->heard = before.heard;
}

const struct db_client *db_control_holder(const struct db_control *control, db_time now)
{
	if (control->holder.id == DB_CLIENT_NOBODY || now >= control->heard + control->timeout)
		return NULL;
	return &control->holder;
}

bool db_control_holds(const struct db_control *control, const struct db_client *client, db_time now)
{
	const struct db_client *holder = db_control_holder(control, now);

	return !control->enabled || (holder && holder->id == client->id);
}

bool db_control_take(struct db_control *control, const struct db_client *client, db_time now)
{
	if (control->enabled && !db_control_holder(control, now)) {
		control->holder = *client;
		control->heard = now;
	}
	return db_control_holds(control, client, now);
}

bool db_control_request(struct db_control *control, const struct db_client *client, db_time now)
{
	const struct db_client *holder = db_control_holder(control, now);

	if (holder && db_client_same(holder->address, client->address)) {
		control->holder = *client;
		control->heard = now;
	}
	return db_control_take(control, client, now);
}

void db_control_release(struct db_control *control, const struct db_client *client)
{
	if (control->holder.id == client->id)
		control->holder.id = DB_CLIENT_NOBODY;
}

void db_control_hear(struct db_control *control, const struct db_client *client, db_time arrived,
                     db_time now)
{
	/* A client that fell silent has lost control, even if no other has taken it since. */
	if (control->enabled && db_control_holds(control, client, now) && arrived > control->heard)
		control->heard = arrived;
}

uint32_t db_control_remaining_ms(const struct db_control *control, db_time now)
{
	db_time left;

	if (!db_control_holder(control, now))
		return 0;
	left = control->heard + control->timeout - now;
	/* Rounded up, so that 0 means that it has expired. */
	return (uint32_t)((left + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
}
