/* SPDX-License-Identifier: Apache-2.0 */
/* Looks up words of the command line in the tables. */
#ifndef DRIVEBRIDGE_CTL_LOOKUP_H
#define DRIVEBRIDGE_CTL_LOOKUP_H

#include "ctl/table.h"

/* Also returns the number of words of its name. NULL: there is none, and the nearest names are
 * printed. */
const struct db_ctl_command *db_ctl_find_command(const struct db_ctl *ctl, int count, char **words,
                                                 int *taken);

/* Whether a command has an option. */
bool db_ctl_takes_option(const struct db_ctl_command *command, const struct db_ctl_option *option);

#endif
