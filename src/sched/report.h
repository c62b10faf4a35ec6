/* SPDX-License-Identifier: Apache-2.0 */
/* What happens to drives, in words for the log: what it is and what to check. Internal to src/sched. */
#ifndef DRIVEBRIDGE_SCHED_REPORT_H
#define DRIVEBRIDGE_SCHED_REPORT_H

#include "drivebridge/axis.h"
#include "drivebridge/config.h"
#include "drivebridge/log.h"

void report_drive(const struct db_log_source *log, const struct db_drive_config *drive,
                  enum db_event event, const struct db_feedback *feedback, db_time now);

/* What a person should look at, for errors that ports are lost or cannot be opened with; "" when
 * there is nothing to say. */
const char *report_advice_for_port(int error);

#endif
