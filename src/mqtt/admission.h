/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which of the commands that arrive are handed to the service: allowed, and meant for now. Whether one with the same id
 * was carried out already the service knows, which a restart of this program does not change. Pure; time is handed in.
 */
#ifndef DRIVEBRIDGE_MQTT_ADMISSION_H
#define DRIVEBRIDGE_MQTT_ADMISSION_H

#include "drivebridge/time.h"
#include "mqtt/command.h"
#include "mqtt/config.h"

/* How a message came. */
struct db_mqtt_arrival {
	const char *drive;
	bool retained; /* its sender wanted the broker to keep it */
	db_time now;
	int64_t us;          /* the same moment by the calendar, since 1970-01-01 UTC */
	db_time sent_behind; /* the broker had it from its sender not before this moment */
	db_time subscribed;  /* since then this program has its messages */
	db_time served;      /* since then the service is the same one */
};

#define DB_MQTT_REASON_MAX 256

/* NULL: it is to be carried out. Else the name of the result that it has, and why. */
const char *db_mqtt_admission_judge(const struct db_mqtt_config *config,
                                    const struct db_mqtt_command *command,
                                    const struct db_mqtt_arrival *arrival,
                                    char why[DB_MQTT_REASON_MAX]);

/* For how long it is still meant, in ms: at least 1, at most twice age-ms. Until then the same message could be taken
 * again. */
unsigned db_mqtt_admission_left_ms(const struct db_mqtt_config *config,
                                   const struct db_mqtt_command *command,
                                   const struct db_mqtt_arrival *arrival);

#endif
