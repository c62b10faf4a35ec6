/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All parameters of a drive, of a file, or of the vendor's delivery state: how two sets differ, and
 * in which order to write one to get the other. Pure.
 */
#ifndef DRIVEBRIDGE_PARAMS_SET_H
#define DRIVEBRIDGE_PARAMS_SET_H

#include <jansson.h>
#include <stdbool.h>

struct db_params {
	char name[256];       /* name of the drive, path of the file, or "default" */
	char family[40];      /* the protocol; "" of defaults */
	char identity[128];   /* as the drive reported it; "": not reported */
	unsigned family_line; /* in the file, the line of `family` */
	json_t *values;       /* by name; null for values that the drive does not report */
	json_t *missing;      /* names of values that it should have reported, NULL for files */
	/* ms by name, for values that a drive has reported; NULL for files, and if the service does
	 * not report ages */
	json_t *ages;
	/* Their description, an array of the interface's type Register; NULL: unknown. Not
	 * owned. */
	const json_t *registers;
};

void db_params_clear(struct db_params *params);

/* Whether an array of names has this one; whether a register has the trait of that name. */
bool db_params_has_name(const json_t *names, const char *name);
bool db_params_has_trait(const json_t *reg, const char *trait);

/* True for a parameter that a file can have: a value that the drive itself holds and may report. */
bool db_params_is_kept(const json_t *reg);

/* The names that a drive's set is read with: its parameters, and the registers that say whether
 * they are known and whose they are. An array that the caller frees. */
json_t *db_params_names(const json_t *registers);

/* Fills a drive's set from the answer to a read of these names. False: its parameters are not known
 * now. In both cases to be cleared. */
bool db_params_take(struct db_params *params, const char *name, const char *family,
                    const json_t *registers, const json_t *answer);

/* Parameters that the drive does not report and need not, as an array that the caller frees. */
json_t *db_params_untold(const struct db_params *drive);

/* How long ago the oldest of its values was read, in ms; -1: the service does not report it. */
json_int_t db_params_oldest_ms(const struct db_params *drive);

/* The vendor's delivery state for drives of the same family, as far as its documents give it. */
void db_params_take_defaults(const struct db_params *like, struct db_params *params);

/* The value of one parameter, NULL when the set does not have it. */
const json_t *db_params_value(const struct db_params *params, const char *name);

/* True if both values are the same for a drive, or both are unknown (NULL, or no number). */
bool db_params_agree(const json_t *one, const json_t *other);

/*
 * The names of those that differ, in the order of the table, as an array that the caller frees. A
 * value in only one of both differs, except where its default is unknown.
 */
json_t *db_params_compare(const struct db_params *one, const struct db_params *other);

/*
 * The order in which parameters are written: an array of arrays of names, which the caller frees;
 * each inner array is written as one. First those that others depend on, then those that put others
 * into effect, last those that set the drive's address or speed, because after them the drive may
 * be unreachable. Of `names` only those that the drive has.
 */
json_t *db_params_order(const json_t *registers, const json_t *names);

/* What to write into `drive` to make it equal to `file`, in three arrays of names. Parameters that
 * the file does not have stay as they are. */
struct db_params_changes {
	json_t *settings;
	json_t *addresses; /* they set the drive's address or speed */
	json_t *states;    /* what the drive does now, no settings: never written */
};
void db_params_find_changes(const struct db_params *drive, const struct db_params *file,
                            struct db_params_changes *changes);
void db_params_clear_changes(struct db_params_changes *changes);

#endif
