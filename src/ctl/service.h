/* SPDX-License-Identifier: Apache-2.0 */
/* Commands, see commands.h. */
#ifndef DRIVEBRIDGE_CTL_SERVICE_H
#define DRIVEBRIDGE_CTL_SERVICE_H

#include "ctl/commands.h"

enum db_ctl_status db_ctl_metrics(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_reload(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_check(struct db_ctl *ctl, int count, char **arguments);

#endif
