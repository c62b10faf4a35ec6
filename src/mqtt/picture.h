/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is known of one drive, and what is to be published of it. Values come as the service sends them; those with
 * codes become the codes' names, bits become lists of names. Time is handed in; allocates as jansson does.
 */
#ifndef DRIVEBRIDGE_MQTT_PICTURE_H
#define DRIVEBRIDGE_MQTT_PICTURE_H

#include "drivebridge/time.h"

#include <jansson.h>
#include <stdbool.h>

struct db_mqtt_picture;

/* The drive as Describe has it, and those of its registers that are published as Registers has them; both stay the
 * caller's. NULL without memory; freed with db_mqtt_picture_free(), NULL is allowed. */
struct db_mqtt_picture *db_mqtt_picture_new(const json_t *drive, const json_t *registers);
void db_mqtt_picture_free(struct db_mqtt_picture *picture);

const char *db_mqtt_picture_name(const struct db_mqtt_picture *picture);

/* The registers that are published, an object by their names. Stays the picture's. */
json_t *db_mqtt_picture_registers(const struct db_mqtt_picture *picture);

/*
 * Takes the values of one sample; `us` is when it was sent, for a drive that does not know the time of its data.
 * Returns the text of what changed since the last one, to be freed, or NULL when nothing did (or without memory).
 */
char *db_mqtt_picture_take(struct db_mqtt_picture *picture, const json_t *values, int64_t us);

/* The same when the service is gone: nothing is known any more. */
char *db_mqtt_picture_forget(struct db_mqtt_picture *picture, int64_t us);

/* Whether the retained state is to be published: when it changed and `interval` has passed since the last time, or
 * after `refresh` in any case. Then counts it as done. */
bool db_mqtt_picture_state_is_due(struct db_mqtt_picture *picture, db_time interval,
                                  db_time refresh, db_time now);

/* Texts to be freed; NULL without memory. */
char *db_mqtt_picture_write_state(const struct db_mqtt_picture *picture);
char *db_mqtt_picture_write_about(const struct db_mqtt_picture *picture);

/* A value of a register with this description as it is published; the caller frees it. */
json_t *db_mqtt_picture_word(const json_t *reg, const json_t *value);

/* The text of a JSON value as everything is published. */
char *db_mqtt_picture_dump(const json_t *json);

#endif
