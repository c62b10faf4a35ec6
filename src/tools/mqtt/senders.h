/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who sent a message, and what he may. A broker does not tell its clients who published a message.
 * Where its access list lets each user publish only to topics that end with his own name, the topic
 * tells; his role and drives stand in the file of users. One thread.
 */
#ifndef DRIVEBRIDGE_MQTT_SENDERS_H
#define DRIVEBRIDGE_MQTT_SENDERS_H

#include "mqtt/config.h"
#include "users/roles.h"

struct db_mqtt_senders;

/* `config` must outlive it. NULL without memory; freed with db_mqtt_senders_free(), NULL is
 * allowed. */
struct db_mqtt_senders *db_mqtt_senders_new(const struct db_mqtt_config *config);
void db_mqtt_senders_free(struct db_mqtt_senders *senders);

/*
 * What the sender may, by the file of users as it is now: a user who is not there, and "", nobody,
 * may only stop, on topics where the broker lets him. Without names in topics everybody may what
 * the configuration's `role` says.
 */
struct db_grant db_mqtt_senders_grant(struct db_mqtt_senders *senders, const char *sender);

#endif
