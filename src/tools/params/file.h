/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text of a set of parameters in a file: the form of a configuration file, with the unit and
 * the meaning of each value after it.
 *
 *	drive "feeder" {
 *		format   = 1
 *		family   = vsmd-serial
 *		identity = "VSMD113_025T-1.0.008.170428"
 *	}
 *
 *	parameters {
 *		spd = 6400	# pulses/s, Preset speed
 *	}
 *
 *	end
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_PARAMS_FILE_H
#define DRIVEBRIDGE_PARAMS_FILE_H

#include "params/set.h"

#include <stdio.h>

#define DB_PARAMS_FILE_MAX 262144 /* bytes of a file */

/* A number in a form that reads back as the same value, down to the last bit of single
 * precision. */
void db_params_write_number(const json_t *value, char *text, size_t size);

/* `drive`: the set read from it. To be freed; NULL without memory. */
char *db_params_write(const struct db_params *drive);

/*
 * Parses the text of the file `path`. `families` has the registers by family; the values of an
 * unknown family are numbers under any name. False: there are mistakes, each reported in `errors`
 * with its line. In both cases to be cleared.
 */
bool db_params_read(struct db_params *params, const char *path, const char *text,
                    const json_t *families, FILE *errors);

#endif
