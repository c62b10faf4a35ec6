/* SPDX-License-Identifier: Apache-2.0 */
/* Where parameter sets come from: drives and files. */
#ifndef DRIVEBRIDGE_CTL_PARAMS_SOURCE_H
#define DRIVEBRIDGE_CTL_PARAMS_SOURCE_H

#include "ctl/session.h"
#include "params/file.h"

/*
 * The parameters of a drive that is there (`fresh`: read from the drive now; if that fails, the
 * reason and the age of the known values are printed), and of a file ("-": standard input).
 * DB_CTL_OK, or the reason is printed. `families` as from db_ctl_read_families(). In every case to
 * be cleared.
 */
enum db_ctl_status db_ctl_params_read_drive(struct db_ctl *ctl, const json_t *families,
                                            const char *name, bool fresh, struct db_params *params);
enum db_ctl_status db_ctl_params_read_file(const struct db_ctl *ctl, const json_t *families,
                                           const char *path, struct db_params *params);

/* DB_CTL_OK: drives or files are of the same family. Else the reason is printed. */
enum db_ctl_status db_ctl_params_check_families(const struct db_ctl *ctl,
                                                const struct db_params *one,
                                                const struct db_params *other);

#endif
