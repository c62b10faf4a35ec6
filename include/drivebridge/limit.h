/* SPDX-License-Identifier: Apache-2.0 */
/* Limits of the configuration that a command can break, as the registers show them. */
#ifndef DRIVEBRIDGE_LIMIT_H
#define DRIVEBRIDGE_LIMIT_H

#include <stdint.h>

/* Values of the `result_limit` register: part of the contract, append only. */
enum db_limit {
	DB_LIMIT_NONE = 0,
	DB_LIMIT_MIN_POSITION = 1,
	DB_LIMIT_MAX_POSITION = 2,
	DB_LIMIT_MAX_VELOCITY = 3,
	DB_LIMIT_MAX_ACCELERATION = 4,
};
#define DB_LIMIT_COUNT 5

/* "none", "min_position" ...; "unknown" outside the enum. Pure; any thread. */
const char *db_limit_name(uint16_t limit);

#endif
