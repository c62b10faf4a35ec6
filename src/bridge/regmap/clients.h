/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Effects of a client's requests in addition to their contents: control of a drive, and feeding its
 * watchdog. Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_CLIENTS_H
#define DRIVEBRIDGE_REGMAP_CLIENTS_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"

struct db_registers;
struct db_view_drive;

/*
 * True if a write of this client may go to the drive's commander: it has control, or takes it now.
 * A stop takes nothing, and the result only shows whether its client has control; it must be
 * executed in any case, but alone, without the rest of its write. Refusals are counted.
 */
bool db_clients_may_write(struct db_view_drive *drive, const struct db_client *client, bool stop);

/* Another client has control: the server counts what it refuses for that. */
void db_clients_count_refusal(const struct db_view_drive *drive, const struct db_client *client);

/* A client addressed a drive, with whatever result: it is alive, and does not lose its control by
 * silence. */
void db_clients_hear(struct db_view_drive *drive, const struct db_client *client);

/*
 * The same with an action that may feed its watchdog, see db_watchdog_feed(). A client with read
 * access only does not keep a machine running, nor does one without control. For writes the drive's
 * commander knows what was admitted, and feeds the watchdog itself.
 */
void db_clients_feed(struct db_view_drive *drive, const struct db_client *client,
                     enum db_watchdog_feed by);

/* The client may no longer write. */
void db_clients_release_control(const struct db_registers *registers,
                                const struct db_client *client);

/* The client's connection has ended: its number may be reused. */
void db_clients_forget(const struct db_registers *registers, const struct db_client *client);

#endif
