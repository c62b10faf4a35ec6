/* SPDX-License-Identifier: Apache-2.0 */
/* Between service and broker: what is published in which topic and when, and what is done with
 * commands. One thread; never waits. */
#ifndef DRIVEBRIDGE_MQTT_PUBLISHER_H
#define DRIVEBRIDGE_MQTT_PUBLISHER_H

#include "drivebridge/time.h"
#include "mqtt/config.h"

#include <stdint.h>
#include <systemd/sd-event.h>

struct db_mqtt_publisher;

/* `config` must outlive it. NULL without memory, or with a file of TLS that cannot be used;
 * freed with db_mqtt_publisher_free(), NULL is allowed. */
struct db_mqtt_publisher *db_mqtt_publisher_new(sd_event *loop,
                                                const struct db_mqtt_config *config);
void db_mqtt_publisher_free(struct db_mqtt_publisher *publisher);

/* As db_program_renew_fn, with the publisher as its context. */
void db_mqtt_publisher_renew(void *context);

/* As db_program_turn_fn, with the publisher as its context. */
db_time db_mqtt_publisher_turn(void *context, db_time now, int64_t us);

#endif
