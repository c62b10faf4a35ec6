/* SPDX-License-Identifier: Apache-2.0 */
/* Commands, see commands.h. */
#ifndef DRIVEBRIDGE_CTL_PARAMS_RESTORE_H
#define DRIVEBRIDGE_CTL_PARAMS_RESTORE_H

#include "ctl/commands.h"

enum db_ctl_status db_ctl_params_restore(struct db_ctl *ctl, int count, char **arguments);

#endif
