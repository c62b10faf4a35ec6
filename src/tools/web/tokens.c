/* SPDX-License-Identifier: Apache-2.0 */
#include "web/tokens.h"

#include <stdio.h>
#include <string.h>

void db_web_tokens_add(struct db_web_tokens *tokens, const char *text, db_time now)
{
	unsigned place = tokens->count % DB_WEB_TOKENS_KEPT;

	if (strlen(text) >= DB_WEB_TOKEN_MAX)
		return;
	snprintf(tokens->kept[place].text, DB_WEB_TOKEN_MAX, "%s", text);
	tokens->kept[place].heard = now;
	tokens->count++;
}

db_time db_web_tokens_age(const struct db_web_tokens *tokens, const char *text, db_time now)
{
	for (unsigned i = 0; text && i < DB_WEB_TOKENS_KEPT && i < tokens->count; i++) {
		unsigned place = (tokens->count - 1 - i) % DB_WEB_TOKENS_KEPT;

		if (strcmp(tokens->kept[place].text, text) == 0)
			return now - tokens->kept[place].heard;
	}
	return DB_TIME_NEVER;
}

void db_web_tokens_write_late(char text[DB_WEB_LATE_TEXT], db_time age)
{
	if (age == DB_TIME_NEVER)
		snprintf(text, DB_WEB_LATE_TEXT, "came too late and was not carried out");
	else
		snprintf(text, DB_WEB_LATE_TEXT, "came %.1f s late and was not carried out",
		         (double)age / (double)DB_NS_PER_S);
}
