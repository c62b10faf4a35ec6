/* SPDX-License-Identifier: Apache-2.0 */
#include "web/attempts.h"

#include <string.h>

/* What an attempt counts for. */
struct counter {
	uint64_t key;
	struct db_attempts_limit limit;
};

#define COUNTERS_MAX 3

static size_t find_counters(const struct db_attempts *attempts,
                            const struct db_web_attempt *attempt,
                            struct counter counters[COUNTERS_MAX])
{
	static const struct db_attempts_limit own = { .most = DB_WEB_ATTEMPTS_AT_ONCE,
		                                      .every = DB_WEB_ATTEMPT_EVERY };
	static const struct db_attempts_limit user = { .most = DB_WEB_ATTEMPTS_AT_ONCE,
		                                       .every = DB_WEB_ATTEMPT_USER_EVERY };
	static const struct db_attempts_limit proxy = { .most = DB_WEB_ATTEMPTS_PROXY_AT_ONCE,
		                                        .every = DB_WEB_ATTEMPT_PROXY_EVERY };
	struct db_web_address prefix = db_web_address_prefix(&attempt->address);
	size_t count = 0;

	if (attempt->device[0] != '\0') {
		counters[count++] = (struct counter){
			db_attempts_key(attempts, 'd', attempt->device, strlen(attempt->device)),
			own
		};
		return count;
	}
	counters[count++] = (struct counter){
		db_attempts_key(attempts, 'a', prefix.bytes, sizeof(prefix.bytes)), own
	};
	counters[count++] = (struct counter){
		db_attempts_key(attempts, 'u', attempt->user, strlen(attempt->user)), user
	};
	if (attempt->proxy)
		counters[count++] = (struct counter){ db_attempts_key(
							      attempts, 'p', attempt->proxy->bytes,
							      sizeof(attempt->proxy->bytes)),
			                              proxy };
	return count;
}

db_time db_web_attempts_take(struct db_attempts *attempts, const struct db_web_attempt *attempt,
                             db_time now)
{
	struct counter counters[COUNTERS_MAX];
	size_t count = find_counters(attempts, attempt, counters);
	db_time longest = 0;

	for (size_t i = 0; i < count; i++) {
		db_time wait = db_attempts_wait(attempts, counters[i].key, counters[i].limit, now);

		longest = wait > longest ? wait : longest;
	}
	for (size_t i = 0; i < count && longest == 0; i++)
		db_attempts_count(attempts, counters[i].key,
		                  counters[i > 0 ? i - 1 : count - 1].key, counters[i].limit, now);
	return longest;
}

void db_web_attempts_give_back(struct db_attempts *attempts, const struct db_web_attempt *attempt)
{
	struct counter counters[COUNTERS_MAX];
	size_t count = find_counters(attempts, attempt, counters);

	for (size_t i = 0; i < count; i++)
		db_attempts_give_back(attempts, counters[i].key, counters[i].limit);
}
