/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a client's requests mean beside their contents: who has control of a drive, and who keeps
 * its watchdog from stopping it. Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_CLIENTS_H
#define DRIVEBRIDGE_REGMAP_CLIENTS_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"

struct db_registers;
struct db_view_drive;

/*
 * Whether a write of this client may go to the drive's commander: it has control, or takes it now.
 * A stop takes nothing and is only told whether it comes from who has control; it is to be executed
 * in any case, but by itself, with nothing else of its write. What is refused is counted.
 */
bool db_clients_may_write(struct db_view_drive *drive, const struct db_client *client, bool stop);

/* Another one has control: the server counts what it refuses for that. */
void db_clients_count_refusal(const struct db_view_drive *drive, const struct db_client *client);

/* A client addressed a drive, whatever came of it: it is there, and does not lose its control by silence. */
void db_clients_hear(struct db_view_drive *drive, const struct db_client *client);

/*
 * ... and did there what may feed its watchdog, see db_watchdog_feed(). Who may only look does not keep a
 * machine running, nor who does not control it. Of what is written the drive's commander knows what was admitted,
 * and feeds it itself.
 */
void db_clients_feed(struct db_view_drive *drive, const struct db_client *client,
                     enum db_watchdog_feed by);

/* It may not write any more. */
void db_clients_release_control(const struct db_registers *registers,
                                const struct db_client *client);

/* Its connection has ended: its number may become another's. */
void db_clients_forget(const struct db_registers *registers, const struct db_client *client);

#endif
