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
struct view_drive;

/* A set of units: unit 1 is bit 0 of the first word. */
#define GROUP_WORDS 16

/* One group command under way, and how the last one went. */
struct group {
	struct db_write_token writer; /* who waits for it */
	bool waits;                   /* the writer was not answered yet */
	uint32_t generation;          /* tells answers of this one from those of older ones */
	unsigned pending;             /* drives that have not ended theirs */
	uint8_t worst;                /* exception so far */
	uint16_t units[GROUP_WORDS];  /* those that a stop of a list is for, as written last */

	/* Shown. */
	uint16_t result;  /* exception of the last group command; 0 = all drives confirmed */
	uint16_t drives;  /* how many it was for */
	uint32_t skew_us; /* between the first and the last drive's command on the wire */
	db_time first_out;
	db_time last_out;
};

/* The following return 0, an exception, or DB_WRITE_LATER, as db_backend.write does. */

/* Stops, quick-stops or disables every drive; those that are offline are stopped when they answer. */
int group_stop(struct db_registers *registers, const struct db_client *client, enum db_command stop,
               struct db_write_token token);
/* Likewise the drives of group.units. 03 when there are none; when some have no drive, the others are
 * stopped all the same, and the answer is 0A. */
int group_stop_listed(struct db_registers *registers, const struct db_client *client,
                      enum db_command stop, struct db_write_token token);
/* Starts what is staged, everywhere at once. 03 when nothing is; 06 when another client has control of
 * one of the drives. */
int group_start(struct db_registers *registers, const struct db_client *client,
                struct db_write_token token);

/* The answer to a part of a group command: taken, and not for a client. */
bool group_answered(struct db_registers *registers, struct db_write_token token,
                    enum db_result result);
/* A drive's part ended; `sent` says when it went out, 0: it did not. */
void group_completed(struct db_registers *registers, struct view_drive *drive, uint32_t ticket,
                     db_time sent);

#endif
