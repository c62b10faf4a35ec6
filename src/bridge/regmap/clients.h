/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Effects of a client's requests in addition to their contents: control of a drive, and feeding its
 * watchdog. Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_CLIENTS_H
#define DRIVEBRIDGE_REGMAP_CLIENTS_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"
#include "drivebridge/server.h"

struct db_registers;
struct db_view_drive;

/*
 * True if a write of this client may go to the drive's commander: it has control, or takes it now.
 * A stop takes nothing, and the result only shows whether its client has control; it must be
 * executed in any case, but alone, without the rest of its write. Refusals are counted.
 */
bool db_clients_may_write(struct db_view_drive *drive, const struct db_client *client, bool stop);

/* What a role may permit, for a drive. */
enum db_permission { DB_MAY_READ, DB_MAY_COMMAND, DB_MAY_SET_PARAMETERS, DB_MAY_CLAIM };

/* True unless the client has a role that does not allow this. */
bool db_clients_are_permitted(const struct db_view_drive *drive, const struct db_client *client,
                              enum db_permission what);
/* The same for a request to this register; a refusal is counted, that of a write recorded, and to
 * be answered with exception 01. */
bool db_clients_permit(const struct db_view_drive *drive, const struct db_client *client,
                       enum db_permission what, uint16_t address);
/* The same for the gateway's own registers, which every client may read; nothing is recorded. */
bool db_clients_permit_gateway(const struct db_registers *registers,
                               const struct db_client *client);
/* For a role, or because another client has control: the server counts what it refuses for that. */
void db_clients_count_refusal(const struct db_registers *registers, const struct db_client *client,
                              enum db_refusal kind);

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

/* db_backend's restricted: the client may no longer write. `context`: a struct db_registers. */
void db_clients_release_control(void *context, const struct db_client *client);

/* db_backend's reassigned: its role may allow less than before, and it loses control of the drives
 * that it may not command. */
void db_clients_release_lost(void *context, const struct db_client *client);

/* The client's connection has ended: its number may be reused. */
void db_clients_forget(struct db_registers *registers, const struct db_client *client);

#endif
