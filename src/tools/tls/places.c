/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/places.h"

#include <string.h>

bool db_tls_places_same(const uint8_t a[16], const uint8_t b[16])
{
	static const uint8_t mapped[12] = { [10] = 0xFF, [11] = 0xFF };
	bool v4 = memcmp(a, mapped, sizeof(mapped)) == 0;

	return memcmp(a, b, v4 ? 16 : 8) == 0 && v4 == (memcmp(b, mapped, sizeof(mapped)) == 0);
}

static size_t count_of(const struct db_tls_places *places, const uint8_t address[16])
{
	size_t count = 0;

	for (size_t i = 0; i < DB_TLS_GREETINGS; i++)
		count += places->places[i].who &&
		         db_tls_places_same(places->places[i].address, address);
	return count;
}

void *db_tls_places_displaced(const struct db_tls_places *places, const uint8_t address[16])
{
	size_t own = count_of(places, address);
	bool full = db_tls_places_count(places) == DB_TLS_GREETINGS;
	const struct db_tls_place *chosen = NULL;
	size_t most = 0;

	if (!full && own < DB_TLS_GREETINGS_PER_ADDRESS)
		return NULL;
	for (size_t i = 0; i < DB_TLS_GREETINGS; i++) {
		const struct db_tls_place *place = &places->places[i];
		size_t count;

		if (!place->who)
			continue;
		count = count_of(places, place->address);
		if (own >= DB_TLS_GREETINGS_PER_ADDRESS &&
		    !db_tls_places_same(place->address, address))
			continue;
		if (count > most || (count == most && chosen && place->order < chosen->order)) {
			chosen = place;
			most = count;
		}
	}
	return chosen ? chosen->who : NULL;
}

static struct db_tls_place *find(struct db_tls_places *places, const void *who)
{
	for (size_t i = 0; i < DB_TLS_GREETINGS; i++) {
		if (places->places[i].who == who)
			return &places->places[i];
	}
	return NULL;
}

void db_tls_places_take(struct db_tls_places *places, const uint8_t address[16], void *who)
{
	struct db_tls_place *place = find(places, NULL);

	if (!place)
		return;
	*place = (struct db_tls_place){ .who = who, .order = ++places->last };
	memcpy(place->address, address, sizeof(place->address));
}

void db_tls_places_leave(struct db_tls_places *places, const void *who)
{
	struct db_tls_place *place = find(places, who);

	if (place)
		*place = (struct db_tls_place){ .who = NULL };
}

void db_tls_places_set_ready(struct db_tls_places *places, const void *who)
{
	struct db_tls_place *place = find(places, who);

	if (place)
		place->ready = true;
}

void *db_tls_places_next(struct db_tls_places *places)
{
	struct db_tls_place *chosen = NULL;
	size_t fewest = 0;

	for (size_t i = 0; i < DB_TLS_GREETINGS; i++) {
		struct db_tls_place *place = &places->places[i];
		size_t count;

		if (!place->who || !place->ready)
			continue;
		count = count_of(places, place->address);
		if (chosen && (count > fewest || (count == fewest && place->order > chosen->order)))
			continue;
		chosen = place;
		fewest = count;
	}
	if (!chosen)
		return NULL;
	chosen->ready = false;
	return chosen->who;
}

bool db_tls_places_any_ready(const struct db_tls_places *places)
{
	for (size_t i = 0; i < DB_TLS_GREETINGS; i++) {
		if (places->places[i].who && places->places[i].ready)
			return true;
	}
	return false;
}

size_t db_tls_places_count(const struct db_tls_places *places)
{
	size_t count = 0;

	for (size_t i = 0; i < DB_TLS_GREETINGS; i++)
		count += places->places[i].who != NULL;
	return count;
}
