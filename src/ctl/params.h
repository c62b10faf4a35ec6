/* SPDX-License-Identifier: Apache-2.0 */
/* Commands, see commands.h. */
#ifndef DRIVEBRIDGE_CTL_PARAMS_H
#define DRIVEBRIDGE_CTL_PARAMS_H

#include "ctl/commands.h"

enum db_ctl_status db_ctl_params_list(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_params_save(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_params_diff(struct db_ctl *ctl, int count, char **arguments);

#endif
