/* SPDX-License-Identifier: Apache-2.0 */
/* The clocks of tools. */
#ifndef DRIVEBRIDGE_CLIENT_CLOCK_H
#define DRIVEBRIDGE_CLIENT_CLOCK_H

#include "drivebridge/time.h"

#include <stdint.h>

/* CLOCK_MONOTONIC. */
db_time db_client_now(void);

/* Microseconds since 1970-01-01 UTC. */
int64_t db_client_wall_us(void);

#endif
