/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One drive in the registers, with its commander and what that calls: the bus takes the requests,
 * and a write's answer goes to the group, the vendor's layout or the client that wait for it.
 * Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_DRIVE_H
#define DRIVEBRIDGE_REGMAP_DRIVE_H

#include "drivebridge/registers.h"

struct db_view_drive;

/*
 * `member` of the roster, without what may change while it is there. `neighbour` is another drive
 * on its bus; null: there is none. Null when out of memory.
 */
struct db_view_drive *db_view_drive_new(struct db_registers *registers,
                                        const struct db_roster *roster,
                                        const struct db_roster_drive *member,
                                        const struct db_view_drive *neighbour);
void db_view_drive_free(struct db_view_drive *drive); /* null is fine */

#endif
