/* SPDX-License-Identifier: Apache-2.0 */
/* Commands, see commands.h. */
#ifndef DRIVEBRIDGE_CTL_HISTORY_H
#define DRIVEBRIDGE_CTL_HISTORY_H

#include "ctl/commands.h"

enum db_ctl_status db_ctl_history(struct db_ctl *ctl, int count, char **arguments);

#endif
