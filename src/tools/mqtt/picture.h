/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is known of one drive, and what to publish of it. Values arrive in the service's form; codes
 * become their names, bits become lists of names. Time is passed in; allocates as jansson does.
 */
#ifndef DRIVEBRIDGE_MQTT_PICTURE_H
#define DRIVEBRIDGE_MQTT_PICTURE_H

#include "drivebridge/time.h"

#include <jansson.h>
#include <stdbool.h>

struct db_mqtt_picture {
	json_t *drive;
	json_t *registers; /* those that are published, by name */
	json_t *values;    /* as last published */
	char quality[16];
	int64_t us;   /* of the data; 0: never */
	bool changed; /* since the state was published */
	bool published;
	db_time published_at;
};

/* The drive from Describe, and its published registers from Registers; both stay the caller's. NULL
 * without memory; freed with db_mqtt_picture_free(), NULL is allowed. */
struct db_mqtt_picture *db_mqtt_picture_new(const json_t *drive, const json_t *registers);
void db_mqtt_picture_free(struct db_mqtt_picture *picture);

const char *db_mqtt_picture_name(const struct db_mqtt_picture *picture);

/*
 * Takes the values of one sample; `us` is when it was sent, for a drive that does not know the time
 * of its data. `values` NULL: the service is gone, and all values become unknown. Returns the text
 * of the changes since the last sample, to be freed, or NULL when there are none (or without
 * memory).
 */
char *db_mqtt_picture_take(struct db_mqtt_picture *picture, const json_t *values, int64_t us);

/* True if the retained state is to be published: when it has changed and `interval` has passed
 * since the last time, or after `refresh` in any case. Then counts it as published. */
bool db_mqtt_picture_state_is_due(struct db_mqtt_picture *picture, db_time interval,
                                  db_time refresh, db_time now);

/* Texts to be freed; NULL without memory: these values, which stay the caller's, with their time
 * and quality; and what values mean. */
char *db_mqtt_picture_write(const struct db_mqtt_picture *picture, json_t *values);
char *db_mqtt_picture_write_about(const struct db_mqtt_picture *picture);

/* The text of a JSON value in the form of all messages. */
char *db_mqtt_picture_dump(const json_t *json);

#endif
