/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Proof of age. A token is a short text with a moment of the service's own clock in it; clients hand it back with what
 * starts or holds a motion, so that bytes which a network or a buffer has delayed move nothing. No other clock is
 * believed, and none has to be set. Opaque to clients: a token of another run of the service is as old as any.
 *
 * Pure. Internal to src/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_TOKEN_H
#define DRIVEBRIDGE_CONTROL_TOKEN_H

#include "drivebridge/time.h"

#include <stdint.h>

/* With its end. */
#define DB_TOKEN_MAX 32

/* What is older starts no motion and holds none. */
#define DB_TOKEN_FRESH_MS 500

/* It is not known how old it is: it is another run's, of the future, or no token at all. */
#define DB_TOKEN_UNKNOWN INT64_C(-1)

/* `run` is a random number of this run of the service. */
void db_token_write(char text[DB_TOKEN_MAX], uint32_t run, db_time now);

/* Milliseconds, from 0; or DB_TOKEN_UNKNOWN. */
int64_t db_token_age_ms(const char *text, uint32_t run, db_time now);

#endif
