/* SPDX-License-Identifier: Apache-2.0 */
/* Between service and broker: what is said in which topic and when, and what is done with commands. One thread; never
 * waits. */
#ifndef DRIVEBRIDGE_MQTT_PUBLISHER_H
#define DRIVEBRIDGE_MQTT_PUBLISHER_H

#include "drivebridge/time.h"
#include "mqtt/acting.h"
#include "mqtt/config.h"
#include "mqtt/plant.h"

#include <poll.h>
#include <stdint.h>

struct db_mqtt_publisher;

/* `config` must outlive it. NULL without memory; freed with db_mqtt_publisher_free(), NULL is allowed. */
struct db_mqtt_publisher *db_mqtt_publisher_new(const struct db_mqtt_config *config);
void db_mqtt_publisher_free(struct db_mqtt_publisher *publisher);

#define DB_MQTT_PUBLISHER_FDS (1 + DB_MQTT_PLANT_FDS + DB_MQTT_ACTING_FDS)

/* For poll(): places without a connection have fd -1. */
void db_mqtt_publisher_watch(const struct db_mqtt_publisher *publisher,
                             struct pollfd fds[DB_MQTT_PUBLISHER_FDS]);
db_time db_mqtt_publisher_due(const struct db_mqtt_publisher *publisher);

/* Does what is to be done; `fds` as poll() left them. `us`: microseconds since 1970-01-01 UTC. */
void db_mqtt_publisher_handle(struct db_mqtt_publisher *publisher,
                              const struct pollfd fds[DB_MQTT_PUBLISHER_FDS], db_time now,
                              int64_t us);

#endif
