/* SPDX-License-Identifier: Apache-2.0 */
/* Reads of a drive's unit and of the gateway's: db_backend's read for each. Network thread only. */
#ifndef DRIVEBRIDGE_REGMAP_READ_H
#define DRIVEBRIDGE_REGMAP_READ_H

#include "drivebridge/server.h"
#include "regmap/image.h"
#include "regmap/index.h"

struct db_registers;
struct db_view_drive;

uint8_t db_read_drive(const struct db_view_drive *drive, const struct db_client *client,
                      enum db_table table, uint16_t address, uint16_t count, uint16_t *values);
uint8_t db_read_gateway(const struct db_registers *registers, const struct db_client *client,
                        enum db_table table, uint16_t address, uint16_t count, uint16_t *values);

/* All that the parts of a drive's image hold, as db_image_fill_drive(), and who has control. */
void db_read_image(struct db_drive_image *image, const struct db_view_drive *drive,
                   const struct db_client *client, unsigned parts, uint16_t low, uint16_t high);

/* Whether what a filled image has for a register is known: not old, nor of a parameter that the drive has not
 * told. */
bool db_read_is_known(const struct db_view_drive *drive, const struct db_drive_image *image,
                      const struct db_cell *cell);

#endif
