/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The places of greetings: connections whose client has not shown a certificate yet. There are few;
 * a new greeting takes the place of the oldest one of its own address where that has its share,
 * else of the address that has most. So nobody's greetings keep those of others out, and they never
 * take a client's place. Addresses are IPv6, or IPv4 v4-mapped; of IPv6 the first 64 bits count,
 * which one host can have all of. Pure.
 */
#ifndef DRIVEBRIDGE_TLS_PLACES_H
#define DRIVEBRIDGE_TLS_PLACES_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_TLS_GREETINGS 32
#define DB_TLS_GREETINGS_PER_ADDRESS 8

struct db_tls_place {
	void *who; /* null: it is free */
	uint8_t address[16];
	uint64_t order; /* of coming */
	bool ready;     /* bytes of it wait to be served */
};

struct db_tls_places {
	uint64_t last;
	struct db_tls_place places[DB_TLS_GREETINGS];
};

/* True if both count as one. */
bool db_tls_places_same(const uint8_t a[16], const uint8_t b[16]);

/* Whose place the next greeting of this address takes; null: a free one. */
void *db_tls_places_displaced(const struct db_tls_places *places, const uint8_t address[16]);

/* There must be a free place. */
void db_tls_places_take(struct db_tls_places *places, const uint8_t address[16], void *who);
/* Of somebody without a place nothing happens. */
void db_tls_places_leave(struct db_tls_places *places, const void *who);
void db_tls_places_set_ready(struct db_tls_places *places, const void *who);

/* Takes the next one out of those that are ready: of the address that has fewest greetings, the
 * oldest. Null: none is. */
void *db_tls_places_next(struct db_tls_places *places);
bool db_tls_places_any_ready(const struct db_tls_places *places);

size_t db_tls_places_count(const struct db_tls_places *places);

#endif
