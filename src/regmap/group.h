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

/* The following return 0, an exception, or DB_WRITE_LATER, as db_backend.write does. */

/* Stops, quick-stops or disables every drive; those that are offline are stopped when they
 * answer. */
int db_group_stop(struct db_registers *registers, const struct db_client *client,
                  enum db_command stop, struct db_write_token token);
/* Likewise the drives of group.units. 03 when there are none; when some have no drive, the others
 * are stopped all the same, and the answer is 0A. */
int db_group_stop_listed(struct db_registers *registers, const struct db_client *client,
                         enum db_command stop, struct db_write_token token);
/* Starts what is staged, everywhere at once. 03 when nothing is; 06 when another client has control
 * of one of the drives. */
int db_group_start(struct db_registers *registers, const struct db_client *client,
                   struct db_write_token token);

/* What is asked of the drives from true to false reaches each bus all at once: not first of one drive
 * and, when that is on the wire, of the others. Not nested. */
void db_group_gather(struct db_registers *registers, bool gathers);

/* The answer to a part of a group command: taken, and not for a client. */
bool db_group_take_answer(struct db_registers *registers, struct db_write_token token,
                          enum db_result result);
/* A drive's part ended; `sent` says when it went out, 0: it did not. */
void db_group_note_sent(struct db_registers *registers, struct db_view_drive *drive,
                        uint32_t ticket, db_time sent);

#endif
