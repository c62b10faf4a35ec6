/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Limits the answers to refused commands, for each drive and for each sender of its commands, so
 * that a flood of refusals does not affect others. Pure; time is passed in. Zeroed memory is a new
 * one.
 */
#ifndef DRIVEBRIDGE_MQTT_RATION_H
#define DRIVEBRIDGE_MQTT_RATION_H

#include "drivebridge/time.h"
#include "mqtt/command.h"
#include "mqtt/topics.h"

/* Per second, all of which may come at once: for a drive, and for one sender of its commands. */
#define DB_MQTT_RATION_DRIVE 100
#define DB_MQTT_RATION_SENDER 50

/* Senders and drives that are counted at the same time. */
#define DB_MQTT_RATION_PLACES 128

struct db_mqtt_ration_place {
	char drive[DB_MQTT_NAME_MAX]; /* "": the place is free */
	char sender[DB_MQTT_USER_MAX + 1];
	bool whole; /* for the drive, of all senders */
	unsigned left;
	db_time since; /* begin of the second that `left` belongs to */
};

struct db_mqtt_ration {
	struct db_mqtt_ration_place places[DB_MQTT_RATION_PLACES];
};

/* True if one more is answered. `sender` from the message, "": not given. */
bool db_mqtt_ration_take(struct db_mqtt_ration *ration, const char *drive, const char *sender,
                         db_time now);

#endif
