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

/* What is logged of `count` knocks from an address; freed by the caller. */
static char *log_of(struct db_client_log_rations *rations, const char *address, db_time now,
                    unsigned count)
{
	FILE *before = stderr;
	char *written = NULL;
	size_t size = 0;
	char *text;

	stderr = open_memstream(&written, &size);
	assert_non_null(stderr);
	for (unsigned i = 0; i < count; i++)
		db_client_log_rationed_for(rations, address, now, DB_CLIENT_WARNING, "%s knocks",
		                           address);
	(void)fclose(stderr);
	stderr = before;
	text = strdup(written);
	free(written);
	return text;
}

static void nobody_hides_the_lines_of_others(void **state)
{
	struct db_client_log_rations rations = { .others = { .count = 0 } };
	db_time begin = 7 * DB_NS_PER_S;
	char *text = log_of(&rations, "10.0.0.66", begin, 1000);

	(void)state;
	assert_int_equal(count_lines(text), DB_CLIENT_LOG_RATION_EACH + 1);
	assert_non_null(strstr(text, "further lines about 10.0.0.66 are left out for a minute"));
	free(text);
	text = log_of(&rations, "10.0.0.5", begin, 1);
	assert_non_null(strstr(text, "10.0.0.5 knocks"));
	free(text);
	/* A network of IPv6 is one address. */
	text = log_of(&rations, "fd00:9::3", begin, DB_CLIENT_LOG_RATION_EACH);
	free(text);
	text = log_of(&rations, "fd00:9::4", begin, 5);
	assert_int_equal(count_lines(text), 1);
	free(text);
	/* The journal does not grow with their number. */
	for (unsigned i = 0; i < 10 * DB_CLIENT_LOG_PLACES; i++) {
		char address[24];

		(void)snprintf(address, sizeof(address), "10.1.%u.%u", i / 250, i % 250);
		text = log_of(&rations, address, begin, 1);
		assert_int_equal(count_lines(text) != 0,
		                 i < DB_CLIENT_LOG_PLACES - 3 + DB_CLIENT_LOG_RATION_EACH + 1);
		free(text);
	}
	text = log_of(&rations, "10.0.0.66", begin + 60 * DB_NS_PER_S, 1);
	assert_non_null(strstr(text, "10.0.0.66 knocks"));
	free(text);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(strangers_fill_no_journal),
		cmocka_unit_test(nobody_hides_the_lines_of_others),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
