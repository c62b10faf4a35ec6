/* SPDX-License-Identifier: Apache-2.0 */
#include "web/attempts.h"

#include <stddef.h>
#include <string.h>

/* FNV-1a. */
static uint64_t mix(uint64_t hash, const void *bytes, size_t count)
{
	const unsigned char *at = bytes;

	for (size_t i = 0; i < count; i++)
		hash = (hash ^ at[i]) * UINT64_C(0x100000001B3);
	return hash;
}

static uint64_t key_of(const struct db_web_attempts *attempts, char kind, const void *bytes,
                       size_t count)
{
	uint64_t hash = mix(UINT64_C(0xCBF29CE484222325), &attempts->seed, sizeof(attempts->seed));

	hash = mix(mix(hash, &kind, 1), bytes, count);
	return hash ? hash : 1;
}

static uint64_t key_of_address(const struct db_web_attempts *attempts,
                               const struct db_web_address *address)
{
	static const unsigned char v4_prefix[12] = { [10] = 0xFF, [11] = 0xFF };
	bool v4 = memcmp(address->bytes, v4_prefix, sizeof(v4_prefix)) == 0;

	return key_of(attempts, 'a', address->bytes, v4 ? 16 : 8);
}

/* Its place, or one that it gets. */
static size_t find_place(struct db_web_attempts *attempts, uint64_t key, size_t other)
{
	size_t place = other == 0 ? 1 : 0;

	for (size_t i = 0; i < DB_WEB_ATTEMPTS_PLACES; i++) {
		if (attempts->places[i].key == key)
			return i;
		if (i != other && attempts->places[i].full < attempts->places[place].full)
			place = i;
	}
	attempts->places[place].key = key;
	attempts->places[place].full = 0;
	return place;
}

/* So long until there is an attempt; 0: there is. */
static db_time wait_of(const struct db_web_attempts *attempts, size_t place, db_time now)
{
	db_time left = attempts->places[place].full - now -
	               (DB_WEB_ATTEMPTS_AT_ONCE - 1) * DB_WEB_ATTEMPT_EVERY;

	return left > 0 ? left : 0;
}

static void use(struct db_web_attempts *attempts, size_t place, db_time now)
{
	if (attempts->places[place].full < now)
		attempts->places[place].full = now;
	attempts->places[place].full += DB_WEB_ATTEMPT_EVERY;
}

db_time db_web_attempts_take(struct db_web_attempts *attempts, const struct db_web_address *address,
                             const char *user, db_time now)
{
	size_t by_address = find_place(attempts, key_of_address(attempts, address),
	                               DB_WEB_ATTEMPTS_PLACES);
	size_t by_user = find_place(attempts, key_of(attempts, 'u', user, strlen(user)),
	                            by_address);
	db_time wait = wait_of(attempts, by_address, now);

	if (wait_of(attempts, by_user, now) > wait)
		wait = wait_of(attempts, by_user, now);
	if (wait > 0)
		return wait;
	use(attempts, by_address, now);
	use(attempts, by_user, now);
	return 0;
}

void db_web_attempts_give_back(struct db_web_attempts *attempts,
                               const struct db_web_address *address, const char *user)
{
	uint64_t keys[] = { key_of_address(attempts, address),
		            key_of(attempts, 'u', user, strlen(user)) };

	for (size_t i = 0; i < DB_WEB_ATTEMPTS_PLACES; i++) {
		if (attempts->places[i].key == keys[0] || attempts->places[i].key == keys[1])
			attempts->places[i].full -= DB_WEB_ATTEMPT_EVERY;
	}
}
