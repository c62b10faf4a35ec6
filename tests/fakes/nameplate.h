/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Nameplates of drives that a test makes up. Header only; any thread.
 *
 *	struct db_nameplate_copy room;
 *	struct db_nameplate plate = fake_nameplate(&room, 1u << VSMD_SPD);
 *
 *	plate.values[VSMD_SPD].f = 6400.0f;
 */
#ifndef DRIVEBRIDGE_FAKES_NAMEPLATE_H
#define DRIVEBRIDGE_FAKES_NAMEPLATE_H

#include "drivebridge/axis.h"

#include <string.h>

/* Of DB_PARAMS_MAX parameters; of the first 64 these were read. It uses the room. */
static inline struct db_nameplate fake_nameplate(struct db_nameplate_copy *room, uint64_t valid)
{
	memset(room, 0, sizeof *room);
	DB_NAMEPLATE_INIT(&room->plate, &room->room, DB_PARAMS_MAX);
	room->plate.valid[0] = valid;
	return room->plate;
}

#endif
