/* SPDX-License-Identifier: Apache-2.0 */
#include "users/attempts.h"

#include "drivebridge/hash.h"

uint64_t db_attempts_key(const struct db_attempts *attempts, char kind, const void *bytes,
                         size_t count)
{
	uint64_t hash = db_hash_add(DB_HASH_BEGIN, &attempts->seed, sizeof(attempts->seed));

	hash = db_hash_add(db_hash_add(hash, &kind, 1), bytes, count);
	return hash ? hash : 1;
}

/* Its index; DB_ATTEMPTS_PLACES: it has none. */
static size_t find_key(const struct db_attempts *attempts, uint64_t key)
{
	size_t place = 0;

	while (place < DB_ATTEMPTS_PLACES && attempts->places[place].key != key)
		place++;
	return place;
}

db_time db_attempts_wait(const struct db_attempts *attempts, uint64_t key,
                         struct db_attempts_limit limit, db_time now)
{
	size_t place = find_key(attempts, key);
	db_time left = place == DB_ATTEMPTS_PLACES ?
	                       0 :
	                       attempts->places[place].full - now - (limit.most - 1) * limit.every;

	return left > 0 ? left : 0;
}

void db_attempts_count(struct db_attempts *attempts, uint64_t key, uint64_t kept,
                       struct db_attempts_limit limit, db_time now)
{
	size_t place = find_key(attempts, key);

	if (place == DB_ATTEMPTS_PLACES) {
		/* A free place has the key 0, as `kept` when there is none. */
		place = kept != 0 && attempts->places[0].key == kept ? 1 : 0;
		for (size_t i = 0; i < DB_ATTEMPTS_PLACES; i++) {
			if ((kept == 0 || attempts->places[i].key != kept) &&
			    attempts->places[i].full < attempts->places[place].full)
				place = i;
		}
		attempts->places[place].key = key;
		attempts->places[place].full = 0;
	}
	if (attempts->places[place].full < now)
		attempts->places[place].full = now;
	attempts->places[place].full += limit.every;
}

void db_attempts_give_back(struct db_attempts *attempts, uint64_t key,
                           struct db_attempts_limit limit)
{
	size_t place = find_key(attempts, key);

	if (place < DB_ATTEMPTS_PLACES)
		attempts->places[place].full -= limit.every;
}
