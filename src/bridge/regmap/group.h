/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands to many drives in one write: staged commands that start together, and a stop of all. The
 * writer is answered when every drive has confirmed or refused. Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_GROUP_H
#define DRIVEBRIDGE_REGMAP_GROUP_H

#include "drivebridge/command.h"
#include "drivebridge/server.h"

#include <stdbool.h>
#include <stdint.h>

struct db_registers;
struct db_view_drive;

struct db_view_space;

/* The following return 0, an exception, or DB_WRITE_LATER, as db_backend.write does. `space` is
 * what the client sees: its results are shown there. */

/* Stops, quick-stops or disables every drive of the gateway, not only those of the space:
 * somebody who presses such a button has no time to ask which endpoint a drive is on. Those that
 * are offline are stopped when they answer. */
int db_group_stop(struct db_registers *registers, const struct db_view_space *space,
                  const struct db_client *client, enum db_command stop,
                  struct db_write_token token);
/* The same for the drives of the space whose units are in its group_units. 03 when there are
 * none; when some have no drive, the others are stopped all the same, and the answer is 0A. */
int db_group_stop_listed(struct db_registers *registers, const struct db_view_space *space,
                         const struct db_client *client, enum db_command stop,
                         struct db_write_token token);
/* Starts everything that is staged in the space, all at once. 03 when nothing is; 01 when the
 * client's role does not allow one of the drives, 06 when another client has control of one of
 * them. */
int db_group_start(struct db_registers *registers, const struct db_view_space *space,
                   const struct db_client *client, struct db_write_token token);

/* Requests to the drives from true to false reach each bus together: not one drive first and, when
 * that is on the wire, the others. Not nested. */
void db_group_gather(struct db_registers *registers, bool gathers);

/* Takes the answer to a part of a group command. True if it was one, and not for a client. */
bool db_group_take_answer(struct db_registers *registers, struct db_write_token token,
                          enum db_result result);
/* A drive's part ended; `sent` is when it was sent, 0: it was not. */
void db_group_note_sent(struct db_view_drive *drive, uint32_t ticket, db_time sent);

#endif
