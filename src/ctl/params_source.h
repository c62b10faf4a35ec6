/* SPDX-License-Identifier: Apache-2.0 */
/* Where sets of parameters come from: drives, files, the vendors' defaults; and how two of them differ. */
#ifndef DRIVEBRIDGE_CTL_PARAMS_SOURCE_H
#define DRIVEBRIDGE_CTL_PARAMS_SOURCE_H

#include "ctl/params_file.h"
#include "ctl/session.h"

/*
 * The parameters of a drive that is there, of a file ("-": standard input), and of either by its name. DB_CTL_OK, or
 * the reason is printed. `families` as db_ctl_read_families() has it. Either way to be cleared.
 */
enum db_ctl_status db_ctl_params_read_drive(struct db_ctl *ctl, const json_t *families,
                                            const char *name, struct db_ctl_params *params);
enum db_ctl_status db_ctl_params_read_file(const struct db_ctl *ctl, const json_t *families,
                                           const char *path, struct db_ctl_params *params);
enum db_ctl_status db_ctl_params_find(struct db_ctl *ctl, const json_t *families, const char *name,
                                      struct db_ctl_params *params);

/* DB_CTL_OK: drives or files are of the same family. Else the reason is printed. */
enum db_ctl_status db_ctl_params_check_families(const struct db_ctl *ctl,
                                                const struct db_ctl_params *one,
                                                const struct db_ctl_params *other);

/* What the vendor delivers drives of the same family with, as far as its documents say. Pure. */
void db_ctl_params_take_defaults(const struct db_ctl_params *like, struct db_ctl_params *params);

/* Of one of them, NULL when the set says nothing of it. Pure. */
const json_t *db_ctl_params_value(const struct db_ctl_params *params, const char *name);

/* Whether both say the same of one of them, or both nothing. Pure. */
bool db_ctl_params_agree(const struct db_ctl_params *one, const struct db_ctl_params *other,
                         const char *name);

/*
 * The names of those that differ, in the order of the table, as an array that the caller frees. What only one of
 * both says differs, but for what a default is not known of. Pure.
 */
json_t *db_ctl_params_compare(const struct db_ctl_params *one, const struct db_ctl_params *other);

/*
 * What is to be written into `drive` so that it is as `file` says: arrays of names, each of what is written as one, in
 * the order in which it is to be done, as an array that the caller frees. What the file says nothing of stays as it
 * is. `addresses`: those that say where the drive is heard, and nothing else, else all but those. What is a state of the drive and no
 * setting is not written. Pure.
 */
json_t *db_ctl_params_plan(const struct db_ctl_params *drive, const struct db_ctl_params *file,
                           bool addresses);

/* The names of states that differ, which stay as they are: an array that the caller frees. Pure. */
json_t *db_ctl_params_states(const struct db_ctl_params *drive, const struct db_ctl_params *file);

#endif
