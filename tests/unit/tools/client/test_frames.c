/* SPDX-License-Identifier: Apache-2.0 */
#include "client/frames.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define LIMIT 256

static int open_frames(void **state)
{
	static struct db_frames frames;

	frames = (struct db_frames){ .limit = LIMIT };
	*state = &frames;
	return 0;
}

static int close_frames(void **state)
{
	free(((struct db_frames *)*state)->bytes);
	return 0;
}

static void expect_message(struct db_frames *frames, const char *name)
{
	json_t *message = NULL;

	assert_int_equal(db_frames_take(frames, &message), 1);
	assert_non_null(json_object_get(message, name));
	json_decref(message);
}

static void test_a_message_comes_in_single_bytes(void **state)
{
	static const char text[] = "{\"one\":1}";
	json_t *message = NULL;

	for (size_t i = 0; i < sizeof(text); i++) {
		assert_int_equal(db_frames_take(*state, &message), 0);
		assert_int_equal(db_frames_add(*state, text + i, 1), 0);
	}
	expect_message(*state, "one");
	assert_int_equal(db_frames_take(*state, &message), 0);
}

static void test_several_messages_come_at_once(void **state)
{
	static const char text[] = "{\"one\":1}\0{\"two\":2}\0{\"three\":3}\0{\"fo";
	json_t *message = NULL;

	assert_int_equal(db_frames_add(*state, text, sizeof(text) - 1), 0);
	expect_message(*state, "one");
	expect_message(*state, "two");
	assert_int_equal(db_frames_add(*state, "ur\":4}", 7), 0);
	expect_message(*state, "three");
	expect_message(*state, "four");
	assert_int_equal(db_frames_take(*state, &message), 0);
}

static void test_what_is_no_object_is_refused(void **state)
{
	static const char *const wrong[] = { "",       "[]",        "3",
		                             "null",   "{",         "{}{}",
		                             "\"{}\"", "{\"a\":1,", "{\"a\":1,\"a\":2}",
		                             "\xff" };
	json_t *message = NULL;

	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_int_equal(db_frames_add(*state, wrong[i], strlen(wrong[i]) + 1), 0);
		assert_int_equal(db_frames_take(*state, &message), -EBADMSG);
		assert_null(message);
	}
	/* And the next is read as if nothing had been. */
	assert_int_equal(db_frames_add(*state, "{\"a\":1}", 8), 0);
	expect_message(*state, "a");
}

static void test_a_message_without_end_is_too_long(void **state)
{
	char bytes[LIMIT + 1];
	json_t *message = NULL;

	memset(bytes, 'a', sizeof(bytes));
	assert_int_equal(db_frames_add(*state, bytes, LIMIT), 0);
	assert_int_equal(db_frames_take(*state, &message), 0);
	assert_int_equal(db_frames_add(*state, bytes, 1), 0);
	assert_int_equal(db_frames_take(*state, &message), -EMSGSIZE);
}

static void test_behind_a_long_message_others_come(void **state)
{
	struct db_frames frames = { .limit = 1024 * 1024 };
	char text[100 * 1024];

	(void)state;
	memset(text, ' ', sizeof(text));
	memcpy(text, "{\"long\":1", 9);
	memcpy(text + sizeof(text) - 2, "}", 2);
	for (unsigned turn = 0; turn < 3; turn++) {
		json_t *message = NULL;

		assert_int_equal(db_frames_add(&frames, text, sizeof(text)), 0);
		assert_int_equal(db_frames_add(&frames, "{\"sh", 4), 0);
		expect_message(&frames, "long");
		assert_int_equal(db_frames_add(&frames, "ort\":2}", 8), 0);
		expect_message(&frames, "short");
		assert_int_equal(db_frames_take(&frames, &message), 0);
	}
	free(frames.bytes);
}

static void test_a_call_is_written_with_its_zero_byte(void **state)
{
	json_t *parameters = json_pack("{s:s}", "drive", "feeder");
	size_t size = 0;
	char *text = db_frames_write_call("a.b.Read", parameters, "more", &size);

	(void)state;
	assert_string_equal(
		text,
		"{\"method\":\"a.b.Read\",\"parameters\":{\"drive\":\"feeder\"},\"more\":true}");
	assert_int_equal(size, strlen(text) + 1);
	free(text);
	text = db_frames_write_call("a.b.Describe", NULL, NULL, &size);
	assert_string_equal(text, "{\"method\":\"a.b.Describe\"}");
	free(text);
	json_decref(parameters);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_a_message_comes_in_single_bytes, open_frames,
		                                close_frames),
		cmocka_unit_test_setup_teardown(test_several_messages_come_at_once, open_frames,
		                                close_frames),
		cmocka_unit_test_setup_teardown(test_what_is_no_object_is_refused, open_frames,
		                                close_frames),
		cmocka_unit_test_setup_teardown(test_a_message_without_end_is_too_long, open_frames,
		                                close_frames),
		cmocka_unit_test(test_behind_a_long_message_others_come),
		cmocka_unit_test(test_a_call_is_written_with_its_zero_byte),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
