/* SPDX-License-Identifier: Apache-2.0 */
#include "client/log.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* What is logged meanwhile; freed by the caller. */
static char *log_many(struct db_client_log_ration *ration, db_time now, unsigned count)
{
	FILE *before = stderr;
	char *written = NULL;
	size_t size = 0;
	char *text;

	stderr = open_memstream(&written, &size);
	assert_non_null(stderr);
	for (unsigned i = 0; i < count; i++)
		db_client_log_rationed(ration, now, DB_CLIENT_WARNING, "knock %u\n", i);
	(void)fclose(stderr);
	stderr = before;
	text = strdup(written);
	free(written);
	return text;
}

static size_t count_lines(const char *text)
{
	size_t count = 0;

	for (const char *at = strchr(text, '\n'); at; at = strchr(at + 1, '\n'))
		count++;
	return count;
}

static void strangers_fill_no_journal(void **state)
{
	struct db_client_log_ration ration = { .count = 0 };
	db_time begin = 7 * DB_NS_PER_S;
	char *text = log_many(&ration, begin, 1000);

	(void)state;
	assert_int_equal(count_lines(text), DB_CLIENT_LOG_RATION + 1);
	assert_non_null(strstr(text, "knock 0?\n"));
	assert_non_null(strstr(text, "knock 29?\n"));
	assert_null(strstr(text, "knock 30"));
	assert_non_null(strstr(text, "left out"));
	free(text);
	text = log_many(&ration, begin + 60 * DB_NS_PER_S - 1, 1000);
	assert_string_equal(text, "");
	free(text);
	/* A minute is over, and what comes is told again. */
	text = log_many(&ration, begin + 60 * DB_NS_PER_S, DB_CLIENT_LOG_RATION);
	assert_int_equal(count_lines(text), DB_CLIENT_LOG_RATION);
	assert_null(strstr(text, "left out"));
	free(text);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(strangers_fill_no_journal),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
