/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The connection to the broker, with libmosquitto in a loop of somebody else's. Connects by itself, again and again,
 * and sends what the outbox has. One thread, no threads of the library; waits for nothing but the name of the broker,
 * where that is no address.
 */
#ifndef DRIVEBRIDGE_MQTT_BROKER_H
#define DRIVEBRIDGE_MQTT_BROKER_H

#include "drivebridge/time.h"
#include "mqtt/config.h"
#include "mqtt/outbox.h"

#include <poll.h>
#include <stdint.h>

struct db_mqtt_broker;

struct db_mqtt_broker_ops {
	/* Before anything is sent over a new connection: the place for db_mqtt_broker_subscribe(). */
	void (*connected)(void *context);
	void (*lost)(void *context);
	/* A message to a subscription; `retained` as its sender published it. Its text is followed by a zero byte.
	 * Nothing of the broker's may be called. */
	void (*message)(void *context, const char *topic, const char *text, size_t length,
	                bool retained);
};

struct db_mqtt_broker_stats {
	uint64_t connections;
	uint64_t sent;    /* messages */
	uint64_t bytes;   /* of their topics and texts */
	uint64_t refused; /* messages that the broker took and threw away */
};

/* `will` is the topic that the broker writes "offline" to when this program is gone. Config and outbox must outlive
 * it. NULL without memory; freed with db_mqtt_broker_free(), NULL is allowed: then the will is published. */
struct db_mqtt_broker *db_mqtt_broker_new(const struct db_mqtt_config *config, const char *will,
                                          struct db_mqtt_outbox *outbox,
                                          const struct db_mqtt_broker_ops *ops, void *context);
void db_mqtt_broker_free(struct db_mqtt_broker *broker);

/* For poll(); fd -1: there is no connection. */
struct pollfd db_mqtt_broker_watch(const struct db_mqtt_broker *broker);
db_time db_mqtt_broker_due(const struct db_mqtt_broker *broker);

/* Does what is to be done. `revents` as poll() has them. */
void db_mqtt_broker_handle(struct db_mqtt_broker *broker, short revents, db_time now);

bool db_mqtt_broker_is_connected(const struct db_mqtt_broker *broker);

/* Messages to this filter, none that was published before. Quality of service 0: each at most once; 1: none is lost while
 * the connection lasts. */
void db_mqtt_broker_subscribe(struct db_mqtt_broker *broker, const char *filter, int qos);

/* At once, past the outbox, with quality of service 1. Nothing where there is no connection or no room, or while the
 * broker has not confirmed the one before. */
void db_mqtt_broker_send_now(struct db_mqtt_broker *broker, const char *topic, const char *text);

struct db_mqtt_broker_stats db_mqtt_broker_read_stats(const struct db_mqtt_broker *broker);

#endif
