/* SPDX-License-Identifier: Apache-2.0 */
/* Commands, see commands.h. */
#ifndef DRIVEBRIDGE_CTL_RECORD_H
#define DRIVEBRIDGE_CTL_RECORD_H

#include "ctl/commands.h"

enum db_ctl_status db_ctl_record(struct db_ctl *ctl, int count, char **arguments);

#endif
