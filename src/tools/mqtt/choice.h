/* SPDX-License-Identifier: Apache-2.0 */
/* What of a plant is published, by the configuration. Allocates as jansson does. */
#ifndef DRIVEBRIDGE_MQTT_CHOICE_H
#define DRIVEBRIDGE_MQTT_CHOICE_H

#include "client/plant.h"
#include "mqtt/config.h"

/* The published registers of a drive: a new array. */
json_t *db_mqtt_choose_registers(const struct db_mqtt_config *config, const json_t *registers);

/* The names of what is published of any drive, and what every message has in addition: a new array.
 * Configured names that no drive has are logged. */
json_t *db_mqtt_collect_names(const struct db_mqtt_config *config,
                              const struct db_plant_drive *drives, size_t count);

/* Whether the configuration lets somebody without a name give this command to the drive. */
bool db_mqtt_choice_allows(const struct db_mqtt_config *config, const char *drive,
                           const char *command, bool stops);

#endif
