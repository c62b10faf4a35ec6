/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data of Sparkplug devices on their way to a broker, in their order: what is to be sent now, and
 * what waits for a session, whose oldest is dropped and counted when there is too much. A message
 * that was sent is kept for a while, because nobody confirms it: when the connection is lost, it
 * may be lost with it, and is sent again as historical.
 *
 * Pure but for memory, which is bounded.
 */
#ifndef DRIVEBRIDGE_MQTT_STORE_H
#define DRIVEBRIDGE_MQTT_STORE_H

#include "drivebridge/time.h"
#include "mqtt/topics.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct db_mqtt_store;

enum db_mqtt_shelf {
	DB_MQTT_SHELF_NOW,    /* of this session */
	DB_MQTT_SHELF_LATER,  /* historical, in its time */
	DB_MQTT_SHELF_PARKED, /* the same, of devices that are not there now */
	DB_MQTT_SHELF_SENT,
	DB_MQTT_SHELVES
};

struct db_mqtt_stored {
	struct db_mqtt_stored *next;
	char device[DB_MQTT_NAME_MAX];
	bool historical; /* it is to be marked so */
	db_time sent;
	size_t length;
	uint8_t metrics[]; /* as db_mqtt_payload_close() wrote them */
};

struct db_mqtt_store_stats {
	size_t messages; /* that wait */
	size_t bytes;    /* their memory, and that of those which were sent */
	uint64_t dropped;
};

/* NULL without memory; freed with db_mqtt_store_free(), NULL is allowed. */
struct db_mqtt_store *db_mqtt_store_new(size_t messages, size_t bytes);
void db_mqtt_store_free(struct db_mqtt_store *store);

/* Keeps a copy. Without room or memory for it, it is dropped and counted. `shelf` is NOW or LATER.
 */
void db_mqtt_store_add(struct db_mqtt_store *store, enum db_mqtt_shelf shelf, const char *device,
                       const uint8_t *metrics, size_t length);

/* The first one of a shelf; NULL: there is none. Stays the store's, until the next call. */
const struct db_mqtt_stored *db_mqtt_store_first(const struct db_mqtt_store *store,
                                                 enum db_mqtt_shelf shelf);

/* The first one of the shelf was sent; it is kept until db_mqtt_store_settle(). */
void db_mqtt_store_sent(struct db_mqtt_store *store, enum db_mqtt_shelf shelf, db_time now);

/* The first one of the shelf is dropped and counted. */
void db_mqtt_store_drop(struct db_mqtt_store *store, enum db_mqtt_shelf shelf);

/* The first one of LATER waits until its device is there. */
void db_mqtt_store_park(struct db_mqtt_store *store);

/* A device is there: all that was parked is looked at again. */
void db_mqtt_store_unpark(struct db_mqtt_store *store);

/* What was sent before this moment has arrived. */
void db_mqtt_store_settle(struct db_mqtt_store *store, db_time before);

/* The session has ended: all waits for the next one. `lost`: without a farewell, and what was sent
 * last may not have arrived. */
void db_mqtt_store_end(struct db_mqtt_store *store, bool lost);

/* What is to be sent now becomes historical: newer values are sent first. */
void db_mqtt_store_defer(struct db_mqtt_store *store);

/* Drops and counts all that waits of a device. */
void db_mqtt_store_forget(struct db_mqtt_store *store, const char *device);

struct db_mqtt_store_stats db_mqtt_store_read_stats(const struct db_mqtt_store *store);

#endif
