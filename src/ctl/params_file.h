/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All parameters of a drive, and the text that keeps them: the form of a configuration file, with the unit and the
 * meaning of each value behind it.
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
#ifndef DRIVEBRIDGE_CTL_PARAMS_FILE_H
#define DRIVEBRIDGE_CTL_PARAMS_FILE_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define DB_CTL_PARAMS_FILE_MAX 262144 /* bytes of a file */

struct db_ctl_params {
	char name[256];       /* of the drive, path of the file, or "default" */
	char family[40];      /* the protocol; "" of defaults */
	char identity[128];   /* as the drive told it; "": it has not */
	unsigned family_line; /* in the file, of what says the family */
	json_t *values;       /* by name; null of what the drive does not tell */
	json_t *missing;      /* names of what it should have told, NULL of files */
	/* What is known of them, an array of the interface's type Register; NULL: nothing. Not owned. */
	const json_t *registers;
};

void db_ctl_params_clear(struct db_ctl_params *params);

/* Whether an array of names has this one; whether a register has the trait of that name. */
bool db_ctl_params_has_name(const json_t *names, const char *name);
bool db_ctl_params_has_trait(const json_t *reg, const char *trait);

/* Whether it is a parameter that a file can have: a value that the drive itself holds and may tell. */
bool db_ctl_params_is_kept(const json_t *reg);

/* A value so that reading it gives the same one, down to the last bit of single precision. */
void db_ctl_params_write_number(const json_t *value, char *text, size_t size);

/* `drive`: what was read of it. To be freed; NULL without memory. */
char *db_ctl_params_write(const struct db_ctl_params *drive);

/*
 * What a text of `path` says. `families` has the registers by family; the values of one that is not there are
 * numbers, whatever they are called. False: it is not right, and each mistake went to `errors` with its line.
 * Either way to be cleared.
 */
bool db_ctl_params_read(struct db_ctl_params *params, const char *path, const char *text,
                        const json_t *families, FILE *errors);

#endif
