/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Announces drives to Home Assistant: a retained document for each value, and for each allowed
 * command without arguments. Pure but for memory.
 */
#ifndef DRIVEBRIDGE_MQTT_DISCOVERY_H
#define DRIVEBRIDGE_MQTT_DISCOVERY_H

#include "mqtt/config.h"
#include "mqtt/picture.h"

/* Receives each topic with its text. */
typedef void db_mqtt_document_fn(void *context, const char *topic, const char *text);

/* The documents of one drive; with `withdraw` empty texts, which remove them. `stops`: an object
 * with the names of commands that stop. */
void db_mqtt_discovery_announce(const struct db_mqtt_config *config,
                                const struct db_mqtt_picture *picture, const json_t *stops,
                                bool withdraw, db_mqtt_document_fn *document, void *context);

#endif
