/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Decides which received commands are passed to the service: those that are allowed, and meant for
 * now. The service knows whether one with the same id was already carried out; a restart of this
 * program does not change that. Pure; time is passed in.
 */
#ifndef DRIVEBRIDGE_MQTT_ADMISSION_H
#define DRIVEBRIDGE_MQTT_ADMISSION_H

#include "drivebridge/time.h"
#include "mqtt/command.h"
#include "mqtt/config.h"

/* How a message arrived. */
struct db_mqtt_arrival {
	const char *drive;
	const struct db_grant *grant; /* of its sender */
	bool retained;                /* its sender asked the broker to retain it */
	db_time now;
	int64_t us;          /* the same moment by the calendar, since 1970-01-01 UTC */
	db_time sent_behind; /* the broker got it from its sender at this moment or later */
	db_time subscribed;  /* since when this program is subscribed */
	db_time served;      /* since when the service has been the same run */
	/* the latest time, by their senders' clocks, of the commands that earlier runs got; 0:
	 * none */
	int64_t newest_before;
	bool had; /* it has no time, and an earlier run got one of its id */
};

#define DB_MQTT_REASON_MAX 256

/* NULL: it is to be carried out. Else the name of its result, and the reason. */
const char *db_mqtt_admission_judge(const struct db_mqtt_config *config,
                                    const struct db_mqtt_command *command,
                                    const struct db_mqtt_arrival *arrival,
                                    char why[DB_MQTT_REASON_MAX]);

/* The time for which it is still valid, in ms: at least 1, at most twice age-ms. Until then the
 * same message could be accepted again. */
unsigned db_mqtt_admission_left_ms(const struct db_mqtt_config *config,
                                   const struct db_mqtt_command *command,
                                   const struct db_mqtt_arrival *arrival);

#endif
