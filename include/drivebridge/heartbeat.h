/* SPDX-License-Identifier: Apache-2.0 */
/* A register that is the sign of life of a PLC's program. Pure; one thread. */
#ifndef DRIVEBRIDGE_HEARTBEAT_H
#define DRIVEBRIDGE_HEARTBEAT_H

#include <stdbool.h>
#include <stdint.h>

struct db_heartbeat {
	uint8_t writer[16]; /* address of the client, as in struct db_client; zero: none yet */
	uint16_t value;
};

/*
 * A value was written. True when the same client had written another one before: of two that both
 * write it, one of them dead, the values alternate, too.
 */
bool db_heartbeat_write(struct db_heartbeat *heartbeat, const uint8_t writer[16], uint16_t value);

#endif
