/* SPDX-License-Identifier: Apache-2.0 */
#include "client/program.h"

#include <getopt.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const char *config;
static bool check;

/* The status for this command line, words with spaces between. */
static int read_line(const char *words)
{
	const struct db_client_option options[] = {
		{ .name = "config", .text = &config },
		{ .name = "check", .flag = &check },
		{ .name = NULL },
	};
	static char text[128];
	char *arguments[8] = { (char *)"tool" };
	int count = 1;

	config = "preset";
	check = false;
	(void)snprintf(text, sizeof(text), "%s", words);
	for (char *word = strtok(text, " "); word; word = strtok(NULL, " "))
		arguments[count++] = word;
	optind = 0;
	return db_client_options_read("tool", "usage\n", options, count, arguments);
}

static void takes_what_it_knows(void **state)
{
	(void)state;
	assert_int_equal(read_line(""), -1);
	assert_string_equal(config, "preset");
	assert_false(check);
	assert_int_equal(read_line("--check --config a.conf"), -1);
	assert_string_equal(config, "a.conf");
	assert_true(check);
	assert_int_equal(read_line("--config=b.conf"), -1);
	assert_string_equal(config, "b.conf");
}

static void ends_with_what_there_is_to_say(void **state)
{
	(void)state;
	assert_int_equal(read_line("--help"), EXIT_SUCCESS);
	assert_int_equal(read_line("--version"), EXIT_SUCCESS);
	assert_int_equal(read_line("--config"), DB_CLIENT_EXIT_USAGE);
	assert_int_equal(read_line("--check=yes"), DB_CLIENT_EXIT_USAGE);
	assert_int_equal(read_line("--port 5"), DB_CLIENT_EXIT_USAGE);
	assert_int_equal(read_line("a.conf"), DB_CLIENT_EXIT_USAGE);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(takes_what_it_knows),
		cmocka_unit_test(ends_with_what_there_is_to_say),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
