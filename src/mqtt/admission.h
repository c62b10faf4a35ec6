/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which of the commands that arrive are carried out: allowed, meant for now, and for the first time. Pure but for memory;
 * time is handed in.
 */
#ifndef DRIVEBRIDGE_MQTT_ADMISSION_H
#define DRIVEBRIDGE_MQTT_ADMISSION_H

#include "drivebridge/time.h"
#include "mqtt/command.h"
#include "mqtt/config.h"

struct db_mqtt_admission;

/* How a message came. */
struct db_mqtt_arrival {
	const char *drive;
	bool retained; /* its sender wanted the broker to keep it */
	db_time now;
	int64_t us;          /* the same moment by the calendar, since 1970-01-01 UTC */
	db_time sent_behind; /* the broker had it from its sender not before this moment */
};

#define DB_MQTT_REASON_MAX 256

/* `config` must outlive it. NULL without memory; freed with db_mqtt_admission_free(), NULL is allowed. */
struct db_mqtt_admission *db_mqtt_admission_new(const struct db_mqtt_config *config);
void db_mqtt_admission_free(struct db_mqtt_admission *admission);

/* NULL: it is to be carried out, and its id is remembered. Else the name of the result that it has, and why. */
const char *db_mqtt_admission_judge(struct db_mqtt_admission *admission,
                                    const struct db_mqtt_command *command,
                                    const struct db_mqtt_arrival *arrival,
                                    char why[DB_MQTT_REASON_MAX]);

#endif
