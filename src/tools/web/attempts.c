/* SPDX-License-Identifier: Apache-2.0 */
#include "web/attempts.h"

#include <string.h>

static const struct db_attempts_limit limit = { .most = DB_WEB_ATTEMPTS_AT_ONCE,
	                                        .every = DB_WEB_ATTEMPT_EVERY };

static uint64_t key_of_address(const struct db_attempts *attempts,
                               const struct db_web_address *address)
{
	static const unsigned char v4_prefix[12] = { [10] = 0xFF, [11] = 0xFF };
	bool v4 = memcmp(address->bytes, v4_prefix, sizeof(v4_prefix)) == 0;

	return db_attempts_key(attempts, 'a', address->bytes, v4 ? 16 : 8);
}

db_time db_web_attempts_take(struct db_attempts *attempts, const struct db_web_address *address,
                             const char *user, db_time now)
{
	uint64_t by_address = key_of_address(attempts, address);
	uint64_t by_user = db_attempts_key(attempts, 'u', user, strlen(user));
	db_time wait = db_attempts_wait(attempts, by_address, limit, now);
	db_time other = db_attempts_wait(attempts, by_user, limit, now);

	if (wait > 0 || other > 0)
		return other > wait ? other : wait;
	db_attempts_count(attempts, by_address, by_user, limit, now);
	db_attempts_count(attempts, by_user, by_address, limit, now);
	return 0;
}

void db_web_attempts_give_back(struct db_attempts *attempts, const struct db_web_address *address,
                               const char *user)
{
	db_attempts_give_back(attempts, key_of_address(attempts, address), limit);
	db_attempts_give_back(attempts, db_attempts_key(attempts, 'u', user, strlen(user)), limit);
}
