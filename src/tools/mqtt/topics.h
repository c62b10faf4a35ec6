/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The topics of one gateway:
 *
 *   PREFIX/GATEWAY/status                    online, no-service, offline (retained)
 *   PREFIX/GATEWAY/figures                   of this program (retained)
 *   PREFIX/GATEWAY/event                     of the service, when they occur
 *   PREFIX/GATEWAY/echo                      from this program to itself: how old a message may be
 *   PREFIX/GATEWAY/trouble                   if all is well, and the configuration's (retained)
 *   PREFIX/GATEWAY/bus/BUS/figures           (retained)
 *   PREFIX/GATEWAY/bus/BUS/trouble           what is wrong with it (retained)
 *   PREFIX/GATEWAY/drive/DRIVE/about         what its values mean (retained)
 *   PREFIX/GATEWAY/drive/DRIVE/state         all values (retained)
 *   PREFIX/GATEWAY/drive/DRIVE/trouble       what is wrong with it (retained)
 *   PREFIX/GATEWAY/drive/DRIVE/changes       values that changed
 *   PREFIX/GATEWAY/drive/DRIVE/command       to this program
 *   PREFIX/GATEWAY/drive/DRIVE/stop          to this program, with any text
 *   PREFIX/GATEWAY/drive/DRIVE/alive         to this program
 *   PREFIX/GATEWAY/drive/DRIVE/command/USER  the same of this user; also stop/USER and alive/USER
 *   PREFIX/GATEWAY/drive/DRIVE/result        the results of commands
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_MQTT_TOPICS_H
#define DRIVEBRIDGE_MQTT_TOPICS_H

#include "mqtt/config.h"

#include <stdbool.h>
#include <stddef.h>

/* The longest topic: prefix and gateway, a name of the service's configuration, the words
 * between. */
#define DB_MQTT_TOPIC_MAX 320
#define DB_MQTT_NAME_MAX 32

struct db_mqtt_topic {
	char text[DB_MQTT_TOPIC_MAX];
};

struct db_mqtt_topic db_mqtt_topic_of_gateway(const struct db_mqtt_config *config,
                                              const char *leaf);
/* Of a part of the plant: `kind` is "drive" or "bus". "+" for its name is a filter for all of them.
 */
struct db_mqtt_topic db_mqtt_topic_of_part(const struct db_mqtt_config *config, const char *kind,
                                           const char *name, const char *leaf);

/* True if `topic` is a topic of some drive, and of which; and of the sender's name
 * where that follows as a last level, else "". */
bool db_mqtt_topic_is_of_drive(const char *topic, const struct db_mqtt_config *config,
                               const char *leaf, char drive[DB_MQTT_NAME_MAX],
                               char sender[DB_MQTT_TOPIC_MAX]);

#endif
