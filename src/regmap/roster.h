/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which drives the registers show, and how another configuration takes the place of one:
 * db_registers_prepare(), _retire(), _apply() and _change_free(). Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_ROSTER_H
#define DRIVEBRIDGE_REGMAP_ROSTER_H

#include "drivebridge/registers.h"

struct db_view_drive;
struct db_view_roster;

/* The drive of this number; null: it has left, or there is no roster yet. */
struct db_view_drive *db_view_roster_find(const struct db_view_roster *roster, uint16_t drive);

/* With its drives; null is fine. */
void db_view_roster_free(struct db_view_roster *roster);

#endif
