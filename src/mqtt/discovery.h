/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How drives are announced to Home Assistant: a retained document for each value, and for each command without
 * arguments that is allowed. Pure but for memory.
 */
#ifndef DRIVEBRIDGE_MQTT_DISCOVERY_H
#define DRIVEBRIDGE_MQTT_DISCOVERY_H

#include "mqtt/config.h"
#include "mqtt/picture.h"

/* Gets each topic with its text. */
typedef void db_mqtt_document_fn(void *context, const char *topic, const char *text);

/* Those of one drive; with `withdraw` empty texts, which take them away again. */
void db_mqtt_discovery_announce(const struct db_mqtt_config *config,
                                const struct db_mqtt_picture *picture, bool withdraw,
                                db_mqtt_document_fn *document, void *context);

#endif
