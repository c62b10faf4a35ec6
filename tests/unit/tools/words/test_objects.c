/* SPDX-License-Identifier: Apache-2.0 */
/* Members and elements of what the service says, whatever it says. */
#include "words/value.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void a_text_that_is_not_there_is_empty(void **state)
{
	json_t *object = json_pack("{s:s, s:i, s:n}", "name", "lift", "unit", 7, "user");

	(void)state;
	assert_string_equal(db_words_text(object, "name"), "lift");
	assert_string_equal(db_words_text(object, "unit"), "");
	assert_string_equal(db_words_text(object, "user"), "");
	assert_string_equal(db_words_text(object, "nothing"), "");
	assert_string_equal(db_words_text(NULL, "name"), "");
	json_decref(object);
}

static void an_object_is_found_by_its_whole_name(void **state)
{
	json_t *objects = json_pack("[{s:s}, {s:s}, {s:i}, i, {s:s}]", "name", "lift", "name",
	                            "lift2", "name", 5, 3, "name", "feeder");

	(void)state;
	assert_ptr_equal(db_words_look_up(objects, "lift"), json_array_get(objects, 0));
	assert_ptr_equal(db_words_look_up(objects, "lift2"), json_array_get(objects, 1));
	assert_ptr_equal(db_words_look_up(objects, "feeder"), json_array_get(objects, 4));
	assert_null(db_words_look_up(objects, "lif"));
	assert_null(db_words_look_up(objects, "saw"));
	assert_null(db_words_look_up(NULL, "lift"));
	json_decref(objects);
}

/* Something else among them is none of them. */
static void a_text_is_found_among_anything(void **state)
{
	json_t *texts = json_pack("[i, s, n, s, {}]", 5, "lift", "feeder");

	(void)state;
	assert_true(db_words_has_text(texts, "lift"));
	assert_true(db_words_has_text(texts, "feeder"));
	assert_false(db_words_has_text(texts, "lif"));
	assert_false(db_words_has_text(texts, ""));
	assert_false(db_words_has_text(NULL, "lift"));
	json_decref(texts);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_text_that_is_not_there_is_empty),
		cmocka_unit_test(an_object_is_found_by_its_whole_name),
		cmocka_unit_test(a_text_is_found_among_anything),
	};

	return cmocka_run_group_tests_name("client: objects", tests, NULL, NULL);
}
