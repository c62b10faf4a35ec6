/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes to a drive's unit: address first (02), then form and range (03), then the commander.
 * Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_WRITE_H
#define DRIVEBRIDGE_REGMAP_WRITE_H

#include "drivebridge/server.h"

struct db_view_drive;

/* db_backend's write. */
int db_write_drive(struct db_view_drive *drive, const struct db_client *client, enum db_table table,
                   uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token);

/* db_backend's write_same. */
int db_write_drive_same(struct db_view_drive *drive, const struct db_client *client,
                        uint16_t address, uint16_t value, struct db_write_token token);

#endif
