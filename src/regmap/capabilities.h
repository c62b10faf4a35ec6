/* SPDX-License-Identifier: Apache-2.0 */
/* What a drive can do, as the capabilities register shows it. Pure. */
#ifndef DRIVEBRIDGE_REGMAP_CAPABILITIES_H
#define DRIVEBRIDGE_REGMAP_CAPABILITIES_H

#include <stdint.h>

#define DB_CAPABILITY_COUNT 18

/* The bits, of a set of commands (DB_COMMAND_BIT()) and measures (enum db_measure). */
uint32_t db_capabilities(uint64_t commands, unsigned measures);
/* "move_velocity" ...; "unknown" from DB_CAPABILITY_COUNT on. */
const char *db_capability_name(unsigned bit);

#endif
