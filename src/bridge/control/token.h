/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Proof of age. A token is a short text that contains a time of the service's own clock; clients
 * return it with calls that start or hold a motion, so that bytes delayed by a network or a buffer
 * move nothing. No other clock is used, and none has to be set. Opaque to clients: the age of a
 * token of another run of the service is unknown.
 *
 * Pure. Internal to src/bridge/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_TOKEN_H
#define DRIVEBRIDGE_CONTROL_TOKEN_H

#include "drivebridge/time.h"

#include <stdint.h>

/* Including its end. */
#define DB_TOKEN_MAX 32

/* An older token starts no motion and holds none. */
#define DB_TOKEN_FRESH_MS 500

/* Its age is not known: it is of another run, of the future, or no token at all. */
#define DB_TOKEN_UNKNOWN INT64_C(-1)

/* `run` is a random number of this run of the service. */
void db_token_write(char text[DB_TOKEN_MAX], uint32_t run, db_time now);

/* Milliseconds, from 0; or DB_TOKEN_UNKNOWN. */
int64_t db_token_age_ms(const char *text, uint32_t run, db_time now);

#endif
