/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The right to command one drive, which one client holds at a time: `control = drive` in the
 * configuration. A client that writes to a drive without a holder takes the right with that write;
 * it is lost by releasing it, by falling silent towards this drive, and with the connection.
 *
 * A client that lost its connection without the bridge noticing comes back on a new one: when it
 * asks for the right, it takes it over from the old connection of the same address.
 *
 * Pure: time is passed in, one thread.
 */
#ifndef DRIVEBRIDGE_CONTROL_H
#define DRIVEBRIDGE_CONTROL_H

#include "drivebridge/client.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

struct db_control {
	bool enabled;
	db_time timeout;
	struct db_client holder; /* DB_CLIENT_NOBODY: nobody; see db_control_holder() */
	db_time heard;           /* the holder's last request to the drive */
};

void db_control_init(struct db_control *control, bool enabled, uint32_t timeout_ms);

/* Other settings: the holder keeps the right, unless it is abolished. */
void db_control_change(struct db_control *control, bool enabled, uint32_t timeout_ms);

/* Null: there is no holder, or it has been silent for too long. */
const struct db_client *db_control_holder(const struct db_control *control, db_time now);

/* True if the client may command: it holds the right, or the drive is not under control. */
bool db_control_holds(const struct db_control *control, const struct db_client *client,
                      db_time now);

/* Takes the right for a write if it is free. True when the client holds it afterwards. */
bool db_control_take(struct db_control *control, const struct db_client *client, db_time now);

/* The same when a client asks for it: also from another connection of the same address. */
bool db_control_request(struct db_control *control, const struct db_client *client, db_time now);

/* The client releases the right, or its connection ends. No effect when it does not hold it. */
void db_control_release(struct db_control *control, const struct db_client *client);

/* A client addressed the drive with a request that arrived then: if it is the holder, it is not
 * silent. */
void db_control_hear(struct db_control *control, const struct db_client *client, db_time arrived,
                     db_time now);

/* Time until the holder's silence ends its right; 0 when there is no holder. */
uint32_t db_control_remaining_ms(const struct db_control *control, db_time now);

#endif
