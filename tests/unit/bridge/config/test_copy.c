/* SPDX-License-Identifier: Apache-2.0 */
/* The copy of a configuration: what is read back is what was written, or nothing. */
#include "config/config_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static char *write_two(void)
{
	struct db_source sources[] = {
		{ .path = (char *)"/etc/a b.conf", .text = (char *)"x = 1\n--- 3 bytes of /no\n" },
		{ .path = (char *)"conf.d/empty.conf", .text = (char *)"" },
		{ .path = (char *)"conf.d/open.conf", .text = (char *)"no line end" },
	};
	char *copy = db_copy_write(sources, sizeof sources / sizeof sources[0]);

	assert_non_null(copy);
	return copy;
}

static void what_was_written_is_read(void **state)
{
	struct db_source *sources;
	size_t count;
	char *copy = write_two();

	(void)state;
	assert_true(db_copy_read(copy, &sources, &count));
	assert_int_equal(count, 3);
	assert_string_equal(sources[0].path, "/etc/a b.conf");
	/* What looks like a part of the copy is the text's own. */
	assert_string_equal(sources[0].text, "x = 1\n--- 3 bytes of /no\n");
	assert_string_equal(sources[1].path, "conf.d/empty.conf");
	assert_string_equal(sources[1].text, "");
	assert_string_equal(sources[2].text, "no line end");
	db_sources_free(sources, count);
	free(copy);
}

static void no_damage_is_read(void **state)
{
	struct db_source *sources;
	size_t count;
	char *copy = write_two();
	size_t length = strlen(copy);

	(void)state;
	for (size_t i = 0; i < length; i++) {
		char kept = copy[i];

		copy[i] = (char)(kept ^ 1);
		assert_false(db_copy_read(copy, &sources, &count));
		db_sources_free(sources, count);
		copy[i] = '\0';
		assert_false(db_copy_read(copy, &sources, &count));
		db_sources_free(sources, count);
		copy[i] = kept;
	}
	free(copy);
}

static void a_path_that_would_look_like_two_lines_is_not_kept(void **state)
{
	struct db_source source = { .path = (char *)"/a\nb", .text = (char *)"" };

	(void)state;
	assert_null(db_copy_write(&source, 1));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_was_written_is_read),
		cmocka_unit_test(no_damage_is_read),
		cmocka_unit_test(a_path_that_would_look_like_two_lines_is_not_kept),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
