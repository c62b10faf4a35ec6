/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/store.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct shelf {
	struct db_mqtt_stored *first;
	struct db_mqtt_stored *last;
};

struct db_mqtt_store {
	size_t messages_max;
	size_t bytes_max;
	struct shelf shelves[DB_MQTT_SHELVES];
	struct db_mqtt_store_stats stats;
};

struct db_mqtt_store *db_mqtt_store_new(size_t messages, size_t bytes)
{
	struct db_mqtt_store *store = calloc(1, sizeof(*store));

	if (!store)
		return NULL;
	store->messages_max = messages;
	store->bytes_max = bytes;
	return store;
}

/* What was sent does not wait. */
static void put_last(struct db_mqtt_store *store, enum db_mqtt_shelf shelf,
                     struct db_mqtt_stored *stored)
{
	struct shelf *place = &store->shelves[shelf];

	stored->next = NULL;
	if (place->last)
		place->last->next = stored;
	else
		place->first = stored;
	place->last = stored;
	store->stats.messages += shelf != DB_MQTT_SHELF_SENT;
}

/* NULL: the shelf is empty. */
static struct db_mqtt_stored *take_first(struct db_mqtt_store *store, enum db_mqtt_shelf shelf)
{
	struct shelf *place = &store->shelves[shelf];
	struct db_mqtt_stored *stored = place->first;

	if (!stored)
		return NULL;
	place->first = stored->next;
	if (!place->first)
		place->last = NULL;
	store->stats.messages -= shelf != DB_MQTT_SHELF_SENT;
	return stored;
}

/* False: the shelf is empty. */
static bool free_first(struct db_mqtt_store *store, enum db_mqtt_shelf shelf)
{
	struct db_mqtt_stored *stored = take_first(store, shelf);

	if (!stored)
		return false;
	store->stats.bytes -= sizeof(*stored) + stored->length;
	free(stored);
	return true;
}

void db_mqtt_store_free(struct db_mqtt_store *store)
{
	if (!store)
		return;
	for (unsigned shelf = 0; shelf < DB_MQTT_SHELVES; shelf++) {
		while (free_first(store, shelf))
			;
	}
	free(store);
}

static bool has_room(const struct db_mqtt_store *store, size_t bytes)
{
	return store->stats.messages < store->messages_max &&
	       store->stats.bytes + bytes <= store->bytes_max;
}

void db_mqtt_store_add(struct db_mqtt_store *store, enum db_mqtt_shelf shelf, const char *device,
                       const uint8_t *metrics, size_t length)
{
	static const enum db_mqtt_shelf order[] = { DB_MQTT_SHELF_PARKED, DB_MQTT_SHELF_LATER,
		                                    DB_MQTT_SHELF_NOW };
	size_t size = sizeof(struct db_mqtt_stored) + length;
	struct db_mqtt_stored *stored;

	/* Copies of what was sent are the first to go, then the oldest of what waits. */
	while (store->stats.bytes + size > store->bytes_max &&
	       free_first(store, DB_MQTT_SHELF_SENT))
		;
	for (size_t i = 0; i < sizeof(order) / sizeof(order[0]); i++) {
		while (!has_room(store, size) && free_first(store, order[i]))
			store->stats.dropped++;
	}
	stored = has_room(store, size) ? malloc(size) : NULL;
	if (!stored) {
		store->stats.dropped++;
		return;
	}
	*stored = (struct db_mqtt_stored){ .historical = shelf != DB_MQTT_SHELF_NOW,
		                           .length = length };
	snprintf(stored->device, sizeof(stored->device), "%s", device);
	memcpy(stored->metrics, metrics, length);
	store->stats.bytes += size;
	put_last(store, shelf, stored);
}

const struct db_mqtt_stored *db_mqtt_store_first(const struct db_mqtt_store *store,
                                                 enum db_mqtt_shelf shelf)
{
	return store->shelves[shelf].first;
}

void db_mqtt_store_sent(struct db_mqtt_store *store, enum db_mqtt_shelf shelf, db_time now)
{
	struct db_mqtt_stored *stored = take_first(store, shelf);

	if (!stored)
		return;
	stored->sent = now;
	put_last(store, DB_MQTT_SHELF_SENT, stored);
}

void db_mqtt_store_drop(struct db_mqtt_store *store, enum db_mqtt_shelf shelf)
{
	store->stats.dropped += free_first(store, shelf);
}

void db_mqtt_store_park(struct db_mqtt_store *store)
{
	struct db_mqtt_stored *stored = take_first(store, DB_MQTT_SHELF_LATER);

	if (stored)
		put_last(store, DB_MQTT_SHELF_PARKED, stored);
}

/* Puts all of a shelf in front of those that are to be sent later. */
static void put_in_front(struct db_mqtt_store *store, enum db_mqtt_shelf shelf)
{
	struct shelf *from = &store->shelves[shelf];
	struct shelf *later = &store->shelves[DB_MQTT_SHELF_LATER];

	if (!from->first)
		return;
	for (struct db_mqtt_stored *at = from->first; at; at = at->next) {
		at->historical = true;
		store->stats.messages += shelf == DB_MQTT_SHELF_SENT;
	}
	from->last->next = later->first;
	if (!later->last)
		later->last = from->last;
	later->first = from->first;
	*from = (struct shelf){ .first = NULL };
}

void db_mqtt_store_unpark(struct db_mqtt_store *store)
{
	put_in_front(store, DB_MQTT_SHELF_PARKED);
}

void db_mqtt_store_settle(struct db_mqtt_store *store, db_time before)
{
	const struct db_mqtt_stored *stored;

	while ((stored = store->shelves[DB_MQTT_SHELF_SENT].first) != NULL && stored->sent < before)
		(void)free_first(store, DB_MQTT_SHELF_SENT);
}

void db_mqtt_store_defer(struct db_mqtt_store *store)
{
	struct db_mqtt_stored *stored;

	while ((stored = take_first(store, DB_MQTT_SHELF_NOW)) != NULL) {
		stored->historical = true;
		put_last(store, DB_MQTT_SHELF_LATER, stored);
	}
}

void db_mqtt_store_end(struct db_mqtt_store *store, bool lost)
{
	db_mqtt_store_defer(store);
	if (lost)
		put_in_front(store, DB_MQTT_SHELF_SENT);
	else
		db_mqtt_store_settle(store, DB_TIME_NEVER);
}

void db_mqtt_store_forget(struct db_mqtt_store *store, const char *device)
{
	for (unsigned shelf = 0; shelf < DB_MQTT_SHELVES; shelf++) {
		struct shelf old = store->shelves[shelf];
		struct db_mqtt_stored *next;

		store->shelves[shelf] = (struct shelf){ .first = NULL };
		for (struct db_mqtt_stored *at = old.first; at; at = next) {
			bool waits = shelf != DB_MQTT_SHELF_SENT;

			next = at->next;
			store->stats.messages -= waits;
			if (strcmp(at->device, device) != 0) {
				put_last(store, shelf, at);
				continue;
			}
			store->stats.dropped += waits;
			store->stats.bytes -= sizeof(*at) + at->length;
			free(at);
		}
	}
}

struct db_mqtt_store_stats db_mqtt_store_read_stats(const struct db_mqtt_store *store)
{
	return store->stats;
}
