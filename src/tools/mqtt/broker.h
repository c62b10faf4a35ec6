/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The connection to a broker, with libmosquitto in the caller's event loop. Connects by itself, and
 * again after a loss, to several brokers in turn, and sends the messages of its source. One thread,
 * no threads of the library; it only waits to resolve the broker's name, if that is not an address.
 */
#ifndef DRIVEBRIDGE_MQTT_BROKER_H
#define DRIVEBRIDGE_MQTT_BROKER_H

#include "drivebridge/time.h"
#include "mqtt/config.h"
#include "mqtt/message.h"

#include <poll.h>
#include <stdint.h>

struct db_mqtt_broker;

/* Where the messages come from that are sent. */
struct db_mqtt_source_ops {
	/* What the broker publishes when this program is gone: asked for once for each attempt to
	 * connect. Valid until the next call. False: without memory. */
	bool (*will)(void *source, struct db_mqtt_message *message);
	/* What is published before this program leaves on purpose; with MQTT 5 the will is, too.
	 * NULL, or false: nothing but the will. */
	bool (*farewell)(void *source, struct db_mqtt_message *message);
	/* The next message to be sent, the same one until the call below; false: there is none now.
	 * Valid until the next call of the source. */
	bool (*next)(void *source, db_time now, struct db_mqtt_message *message);
	/* It was sent with this number, whose confirmation will be reported; 0: it needs none. Or
	 * `refused`, then with 0: this broker can never accept it. */
	void (*sent)(void *source, int number, bool refused, db_time now);
	void (*confirmed)(void *source, int number); /* may be null */
};

struct db_mqtt_broker_ops {
	/* Before anything is sent over a new connection: the place for
	 * db_mqtt_broker_subscribe(). */
	void (*connected)(void *context);
	void (*lost)(void *context);
	/* A message of a subscription; `retained` as its sender published it. The text has a
	 * terminating zero byte. Must not call functions of the broker. */
	void (*message)(void *context, const char *topic, const char *text, size_t length,
	                bool retained);
};

struct db_mqtt_broker_stats {
	uint64_t connections;
	uint64_t sent;    /* messages */
	uint64_t bytes;   /* of their topics and texts */
	uint64_t refused; /* messages that the broker did not accept */
	/* the end of this client's certificate, in seconds since 1970-01-01 UTC; 0: none */
	int64_t certificate_ends;
};

/* Config, source and both tables must outlive it. NULL without memory, or with a file that cannot
 * be used; freed with db_mqtt_broker_free(), NULL is allowed: then the farewell or the will is
 * published. */
struct db_mqtt_broker *db_mqtt_broker_new(const struct db_mqtt_config *config,
                                          const struct db_mqtt_source_ops *source_ops, void *source,
                                          const struct db_mqtt_broker_ops *ops, void *context);
void db_mqtt_broker_free(struct db_mqtt_broker *broker);

/* For poll(); fd -1: there is no connection. *due is brought forward to when there is work without
 * an event. */
struct pollfd db_mqtt_broker_watch(const struct db_mqtt_broker *broker, db_time *due);

/* Does the work that is due, and says in the log that the certificate ends. `revents` from poll();
 * `us`: microseconds since 1970-01-01 UTC. */
void db_mqtt_broker_handle(struct db_mqtt_broker *broker, short revents, db_time now, int64_t us);

/* Reads the files of TLS again, for the next connection; what cannot be used stays as it was. */
void db_mqtt_broker_renew(struct db_mqtt_broker *broker);

/* Subscribes to messages of this filter. `kept`: also to those that the broker has retained.
 * Quality of service 0: each at most once; 1: none is lost while the connection lasts. */
void db_mqtt_broker_subscribe(struct db_mqtt_broker *broker, const char *filter, int qos,
                              bool kept);

/* Leaves this broker for the next one, or for a new connection when there is one only. Does nothing
 * without a connection. The reason is logged. */
void db_mqtt_broker_leave(struct db_mqtt_broker *broker, const char *why, db_time now);

/* Sends at once, past the outbox, with quality of service 1. Does nothing without a connection or
 * room, or while the broker has not confirmed the former one. */
void db_mqtt_broker_send_now(struct db_mqtt_broker *broker, const char *topic, const char *text);

struct db_mqtt_broker_stats db_mqtt_broker_read_stats(const struct db_mqtt_broker *broker);

#endif
