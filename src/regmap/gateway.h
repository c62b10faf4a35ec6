/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes to the gateway's unit: commands to many drives, and the heartbeat for all. Network thread
 * only.
 */
#ifndef DRIVEBRIDGE_REGMAP_GATEWAY_H
#define DRIVEBRIDGE_REGMAP_GATEWAY_H

#include "drivebridge/server.h"

struct db_registers;

/* db_backend's write. */
int db_gateway_write(struct db_registers *registers, const struct db_client *client,
                     enum db_table table, uint16_t address, uint16_t count, const uint16_t *values,
                     struct db_write_token token);

/* db_backend's write_same: it changes nothing here. */
int db_gateway_write_same(const struct db_registers *registers, uint16_t address);

#endif
