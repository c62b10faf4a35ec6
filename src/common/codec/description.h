/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A frame in words for people: its request or answer, with values, units and the vendor's names.
 * Each family's codec fills one in. Pure; any thread.
 */
#ifndef DRIVEBRIDGE_CODEC_DESCRIPTION_H
#define DRIVEBRIDGE_CODEC_DESCRIPTION_H

#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_DESCRIPTION_MAX 2048

#define DB_DESCRIBED_NOBODY (-1) /* the frame does not show its sender */
#define DB_DESCRIBED_ALL 0       /* to every drive */

struct db_description {
	int address; /* address of the drive that is asked or that answers */
	int axis;    /* axis of a controller with several, 0 = x; -1: not given */
	bool secret; /* it contains a secret, such as a password: do not show its bytes */
	size_t length;
	char text[DB_DESCRIPTION_MAX]; /* "": not known */
};

void db_description_begin(struct db_description *description);

/* Text that does not fit any more is left out. */
void db_description_add(struct db_description *description, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

/* A float in its shortest form. */
void db_description_add_float(struct db_description *description, float number, const char *unit);

/* "spd 6400 pulses/s" */
void db_description_add_param(struct db_description *description, const struct db_param *param,
                              union db_value value);

/* The names of the bits that are set, separated by blanks; for bits without a name their number;
 * "none". */
void db_description_add_bits(struct db_description *description, const struct db_drive_bit *bits,
                             size_t count, uint32_t value);

#endif
