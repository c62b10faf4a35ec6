/* SPDX-License-Identifier: Apache-2.0 */
/* When something that failed is tried again: soon at first, then after ever longer times. Pure. */
#ifndef DRIVEBRIDGE_MQTT_RETRY_H
#define DRIVEBRIDGE_MQTT_RETRY_H

#include "drivebridge/time.h"

#include <stdbool.h>

#define DB_MQTT_RETRY_FIRST (1 * DB_NS_PER_S)
#define DB_MQTT_RETRY_LONGEST (60 * DB_NS_PER_S)

/* Zeroed after a success, and before the first attempt. */
struct db_mqtt_retry {
	db_time due;  /* no attempt before; 0: at once */
	db_time wait; /* between the last failure and `due`, without the random part */
};

/* `chance` adds up to half of the time, so that not all gateways of a plant return to their broker
 * at once. */
void db_mqtt_retry_fail(struct db_mqtt_retry *retry, db_time now, unsigned chance);

/* A connection is lost: the first attempt after it. `spread`: a random part of it is waited for in
 * addition. `others`: there is another one to try, at once but for the spread. */
void db_mqtt_retry_lose(struct db_mqtt_retry *retry, db_time now, db_time spread, bool others,
                        unsigned chance);

#endif
