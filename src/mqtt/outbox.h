/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is to be published: samples one behind the other in each lane, of which the oldest are dropped and counted when
 * there are too many, and the latest text of each retained topic, which a newer one replaces. A message stays until the
 * broker has confirmed it.
 *
 * Pure but for memory, which is bounded: samples by the limits, retained texts by their topics.
 */
#ifndef DRIVEBRIDGE_MQTT_OUTBOX_H
#define DRIVEBRIDGE_MQTT_OUTBOX_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct db_mqtt_outbox;

struct db_mqtt_message {
	const char *topic;
	const char *payload;
	bool retained;
};

struct db_mqtt_outbox_stats {
	size_t messages; /* samples that wait for their sending */
	size_t bytes;    /* of memory that they take, and those that wait for their confirmation */
	uint64_t dropped;
	uint64_t confirmed;
};

/* NULL without memory; freed with db_mqtt_outbox_free(), NULL is allowed. */
struct db_mqtt_outbox *db_mqtt_outbox_new(size_t messages, size_t bytes);
void db_mqtt_outbox_free(struct db_mqtt_outbox *outbox);

/* A lane is sent when those before it are empty; dropped are those of the last one first. */
enum db_mqtt_lane {
	DB_MQTT_PROMPT, /* what became of commands, and events */
	DB_MQTT_USUAL,
	DB_MQTT_LAST, /* refusals */
	DB_MQTT_LANES
};

/* Keeps copies. A sample that there is no room or memory for is dropped and counted. */
void db_mqtt_outbox_add_sample(struct db_mqtt_outbox *outbox, enum db_mqtt_lane lane,
                               const char *topic, const char *payload);

/* Replaces the topic's text; "" takes the topic away from the broker. Without memory the former text stays. */
void db_mqtt_outbox_set_retained(struct db_mqtt_outbox *outbox, const char *topic,
                                 const char *payload);

/* Messages whose confirmation is awaited at the same time: enough for a line with a long way, few enough that a broker
 * which is slow shows here and nowhere else. */
#define DB_MQTT_WINDOW 16

/* What is to be sent next, retained texts first; false when there is nothing, or so many are on their way. Stays valid
 * until the next call. */
bool db_mqtt_outbox_next(struct db_mqtt_outbox *outbox, struct db_mqtt_message *message);

/* That one is on its way under this number, whose confirmation db_mqtt_outbox_confirm() tells; or it is confirmed
 * by its sending. */
void db_mqtt_outbox_sent(struct db_mqtt_outbox *outbox, int number);
void db_mqtt_outbox_sent_for_good(struct db_mqtt_outbox *outbox);
void db_mqtt_outbox_confirm(struct db_mqtt_outbox *outbox, int number);

/* The connection is another one: what was on its way is to be sent again, and all retained texts, which the broker
 * may have lost. */
void db_mqtt_outbox_start_over(struct db_mqtt_outbox *outbox);

struct db_mqtt_outbox_stats db_mqtt_outbox_read_stats(const struct db_mqtt_outbox *outbox);

#endif
