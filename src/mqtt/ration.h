/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How many refusals are answered: so many for each drive, and for each sender of its commands, that whoever sends what
 * nobody takes costs the others nothing. Pure; time is handed in. Zeroed memory is a new one.
 */
#ifndef DRIVEBRIDGE_MQTT_RATION_H
#define DRIVEBRIDGE_MQTT_RATION_H

#include "drivebridge/time.h"
#include "mqtt/command.h"
#include "mqtt/topics.h"

/* A second's, all of which may come at once: for a drive, and for one sender of its commands. */
#define DB_MQTT_RATION_DRIVE 100
#define DB_MQTT_RATION_SENDER 50

/* Senders and drives that are told apart at the same time. */
#define DB_MQTT_RATION_PLACES 128

struct db_mqtt_ration_place {
	char drive[DB_MQTT_NAME_MAX]; /* "": the place is free */
	char sender[DB_MQTT_USER_MAX + 1];
	bool whole; /* the drive's, of all senders */
	unsigned left;
	db_time since; /* of the second that `left` is left of */
};

struct db_mqtt_ration {
	struct db_mqtt_ration_place places[DB_MQTT_RATION_PLACES];
};

/* Whether one more is answered. `sender` as the message has it, "": it does not say. */
bool db_mqtt_ration_take(struct db_mqtt_ration *ration, const char *drive, const char *sender,
                         db_time now);

#endif
