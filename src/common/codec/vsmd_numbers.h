/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Numbers in the texts of VSMD drives on serial lines, both directions. The decimal separator is a
 * point whatever the locale. Pure; any thread.
 */
#ifndef DRIVEBRIDGE_CODEC_VSMD_NUMBERS_H
#define DRIVEBRIDGE_CODEC_VSMD_NUMBERS_H

#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>

/*
 * A plain decimal number: sign, digits, fraction; no exponent, no other notation and no locale.
 * Fills *number and *whole (has no fraction, or one of zeros only). False for anything else.
 */
bool vsmd_parse_number(const char *text, size_t length, double *number, bool *whole);

/* A value as drives send it, where an exponent is allowed. False: no number, or not of the type. */
bool vsmd_parse_value(enum db_type type, const char *text, size_t length, union db_value *value);

/* One value as the codec writes it on the wire (terminated). Length or VSMD_ERR_SPACE. */
int vsmd_format_value(enum db_type type, union db_value value, char *text, size_t size);

#endif
