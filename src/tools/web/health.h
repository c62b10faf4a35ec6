/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How drives have been, and alarms, as far as a user's list of drives goes. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_HEALTH_H
#define DRIVEBRIDGE_WEB_HEALTH_H

#include "web/request.h"

/* {"for_s": how far back, "step_s": 60, 900 or 3600}, and for Health "drive": answers with what the
 * service has, and with its time as now_us. Over a connection of its own, because a disk may take
 * its time; a few at once, others are refused. */
void db_web_health(struct db_web_request *request);

/* {"after": a change, 0: all}: alarms of the user's drives, of buses and of the configuration. */
void db_web_alarms(struct db_web_request *request);

/* {"id", "drive"}: the alarm, which has to be of this drive; "": any. */
void db_web_acknowledge(struct db_web_request *request);

#endif
