/* SPDX-License-Identifier: Apache-2.0 */
/* Reads of a drive's unit and of the gateway's: db_backend's read for each. Network thread only. */
#ifndef DRIVEBRIDGE_REGMAP_READ_H
#define DRIVEBRIDGE_REGMAP_READ_H

#include "drivebridge/server.h"

struct db_registers;
struct db_view_drive;

uint8_t db_read_drive(const struct db_view_drive *drive, const struct db_client *client,
                      enum db_table table, uint16_t address, uint16_t count, uint16_t *values);
uint8_t db_read_gateway(const struct db_registers *registers, const struct db_client *client,
                        enum db_table table, uint16_t address, uint16_t count, uint16_t *values);

#endif
