/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Remembers commands without a time that were passed to the service. When the service ends it
 * forgets their ids, and nothing in such a message shows that it was sent before. Pure; time is
 * passed in. Zeroed memory is a new one.
 */
#ifndef DRIVEBRIDGE_MQTT_PAST_H
#define DRIVEBRIDGE_MQTT_PAST_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* As long as the service remembers ids itself: a sender may then count anew. And as many as it
 * remembers of 16 drives; of more the oldest is forgotten. */
#define DB_MQTT_PAST_LASTS (120 * DB_NS_PER_S)
#define DB_MQTT_PAST_PLACES 1024

struct db_mqtt_past {
	struct db_mqtt_past_place {
		uint64_t key; /* 0: free */
		db_time seen;
		bool over; /* an earlier run of the service got it */
	} places[DB_MQTT_PAST_PLACES];
};

/* Which command it is, of whom: never 0. */
uint64_t db_mqtt_past_key(const char *drive, const char *user, const char *id);

/* It was passed to the service. */
void db_mqtt_past_note(struct db_mqtt_past *past, uint64_t key, db_time now);
/* The service has begun again. */
void db_mqtt_past_end_run(struct db_mqtt_past *past);
/* True if an earlier run of the service got it; as long as it is sent again and again that is not
 * forgotten. */
bool db_mqtt_past_had(struct db_mqtt_past *past, uint64_t key, db_time now);

#endif
