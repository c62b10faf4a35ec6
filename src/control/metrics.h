/* SPDX-License-Identifier: Apache-2.0 */
/* Everything that is counted or measured, in the text format of Prometheus. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_METRICS_H
#define DRIVEBRIDGE_CONTROL_METRICS_H

#include "control/call.h"

void db_metrics_call(const struct db_call *call);

#endif
