/* SPDX-License-Identifier: Apache-2.0 */
/* Arguments of the form NAME=VALUE. */
#ifndef DRIVEBRIDGE_CTL_ASSIGN_H
#define DRIVEBRIDGE_CTL_ASSIGN_H

#include "ctl/session.h"

/*
 * An object of them with the values that these registers take, which the caller frees. NULL with `status` when a name
 * or a value is wrong: the reason is printed with what would be right. `unknown`: "feeder has no register".
 */
json_t *db_ctl_read_assignments(const struct db_ctl *ctl, const json_t *registers,
                                const char *unknown, int count, char **arguments,
                                enum db_ctl_status *status);

#endif
