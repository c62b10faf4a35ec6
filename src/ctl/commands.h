/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What drivebridgectl can be told. Each function has its arguments behind the command's name, as many as
 * the table allows, and returns the status to end with.
 */
#ifndef DRIVEBRIDGE_CTL_COMMANDS_H
#define DRIVEBRIDGE_CTL_COMMANDS_H

#include "ctl/session.h"

typedef enum db_ctl_status db_ctl_function(struct db_ctl *ctl, int count, char **arguments);

#endif
