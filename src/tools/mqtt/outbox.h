/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The messages to publish: the samples of each lane in order, the oldest of which are dropped and
 * counted when there are too many, and the latest text of each retained topic, which replaces the
 * former one. A message stays until the broker has confirmed it.
 *
 * Pure but for memory, which is bounded: samples by the limits, retained texts by their topics.
 */
#ifndef DRIVEBRIDGE_MQTT_OUTBOX_H
#define DRIVEBRIDGE_MQTT_OUTBOX_H

#include "mqtt/message.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct db_mqtt_outbox;

struct db_mqtt_outbox_stats {
	size_t messages; /* waiting samples */
	size_t bytes;    /* their memory, and that of unconfirmed samples */
	uint64_t dropped;
	uint64_t confirmed;
};

/* NULL without memory; freed with db_mqtt_outbox_free(), NULL is allowed. */
struct db_mqtt_outbox *db_mqtt_outbox_new(size_t messages, size_t bytes);
void db_mqtt_outbox_free(struct db_mqtt_outbox *outbox);

/* A lane is sent when those before it are empty; the last lane is dropped first. */
enum db_mqtt_lane {
	DB_MQTT_PROMPT, /* results of commands, and events */
	DB_MQTT_USUAL,
	DB_MQTT_LAST, /* refusals */
	DB_MQTT_LANES
};

/* Keeps copies. A sample without room or memory for it is dropped and counted. */
void db_mqtt_outbox_add_sample(struct db_mqtt_outbox *outbox, enum db_mqtt_lane lane,
                               const char *topic, const char *payload);

/* Replaces the topic's text; "" removes the topic from the broker. Without memory the former text
 * stays. */
void db_mqtt_outbox_set_retained(struct db_mqtt_outbox *outbox, const char *topic,
                                 const char *payload);

/* Most unconfirmed messages at the same time: enough for a connection with a long delay, and few
 * enough that the messages for a slow broker pile up only here. */
#define DB_MQTT_WINDOW 16

/* The next message, retained texts first, whose quality of service is left to the caller; false
 * when there is none, or when too many are unconfirmed. Valid until the next call. */
bool db_mqtt_outbox_next(struct db_mqtt_outbox *outbox, struct db_mqtt_message *message);

/* That message was sent with this number, above 0, and db_mqtt_outbox_confirm() reports its
 * confirmation; 0: it needs none. */
void db_mqtt_outbox_sent(struct db_mqtt_outbox *outbox, int number);
void db_mqtt_outbox_confirm(struct db_mqtt_outbox *outbox, int number);

/* There is a new connection: unconfirmed messages are to be sent again, and all retained texts,
 * which the broker may have lost. */
void db_mqtt_outbox_start_over(struct db_mqtt_outbox *outbox);

struct db_mqtt_outbox_stats db_mqtt_outbox_read_stats(const struct db_mqtt_outbox *outbox);

#endif
