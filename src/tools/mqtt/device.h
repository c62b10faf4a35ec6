/* SPDX-License-Identifier: Apache-2.0 */
/* A drive as a Sparkplug device: which metrics it has. Pure but for memory. */
#ifndef DRIVEBRIDGE_MQTT_DEVICE_H
#define DRIVEBRIDGE_MQTT_DEVICE_H

#include "client/plant.h"
#include "mqtt/acting.h"
#include "mqtt/config.h"
#include "mqtt/points.h"

/* What is kept of a drive's registers and commands: as db_mqtt_form_ops has it. */
json_t *db_mqtt_device_keep(const struct db_mqtt_config *config, json_t *received, bool commands);

/* The metrics of the drive: its values, and when commands are allowed for it, these, and their
 * results. `family` is the name of its template. NULL without memory. */
struct db_mqtt_points *db_mqtt_device_new(const struct db_mqtt_config *config,
                                          struct db_mqtt_aliases *aliases,
                                          const struct db_plant_drive *drive, const char *family,
                                          const json_t *stops);

/* Adds the metrics that are the same for all: DB_MQTT_RESULT, that tell of a command's result, or
 * DB_MQTT_MARK, that come with a command. False without memory. */
bool db_mqtt_device_add_common(struct db_mqtt_points *points, enum db_mqtt_point_kind kind);

/* Takes the values of a sample; `us` is when it was sent, for a drive that does not know the time
 * of its data. True: the drive answers. Without an answer the former values stay. */
bool db_mqtt_device_take(struct db_mqtt_points *points, const json_t *values, int64_t us);

/* Takes the result of a command, at `us`. */
void db_mqtt_device_note(struct db_mqtt_points *points, const struct db_mqtt_outcome *outcome,
                         int64_t us);

#endif
