/* SPDX-License-Identifier: Apache-2.0 */
#include "control/token.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

void db_token_write(char text[DB_TOKEN_MAX], uint32_t run, db_time now)
{
	snprintf(text, DB_TOKEN_MAX, "%08" PRIx32 "-%" PRId64, run, (int64_t)(now / DB_NS_PER_MS));
}

int64_t db_token_age_ms(const char *text, uint32_t run, db_time now)
{
	int64_t now_ms = (int64_t)(now / DB_NS_PER_MS);
	char own[DB_TOKEN_MAX];
	const char *digits;
	size_t length;
	size_t count;
	int64_t ms = 0;

	db_token_write(own, run, now);
	length = strcspn(own, "-") + 1;
	if (strncmp(text, own, length) != 0)
		return DB_TOKEN_UNKNOWN;
	digits = text + length;
	count = strspn(digits, "0123456789");
	/* 18 digits fit. */
	if (count == 0 || count > 18 || digits[count] != '\0')
		return DB_TOKEN_UNKNOWN;
	for (size_t i = 0; i < count; i++)
		ms = 10 * ms + (digits[i] - '0');
	return ms > now_ms ? DB_TOKEN_UNKNOWN : now_ms - ms;
}
