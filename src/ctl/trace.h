/* SPDX-License-Identifier: Apache-2.0 */
/* Commands, see commands.h. */
#ifndef DRIVEBRIDGE_CTL_TRACE_H
#define DRIVEBRIDGE_CTL_TRACE_H

#include "ctl/commands.h"

enum db_ctl_status db_ctl_trace(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_traces(struct db_ctl *ctl, int count, char **arguments);

#endif
