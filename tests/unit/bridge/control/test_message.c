/* SPDX-License-Identifier: Apache-2.0 */
/* Calls in varlink's wire format: what is one, what is wrong with the others, and what answers look like. */
#include "control/message.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const char *parse(const char *text, struct db_message *message)
{
	return db_message_parse(text, strlen(text), message);
}

static void a_call_is_taken_apart(void **state)
{
	struct db_message message;

	(void)state;
	assert_null(
		parse("{\"method\":\"a.B.C\",\"parameters\":{\"x\":1},\"more\":true}", &message));
	assert_string_equal(message.method, "a.B.C");
	assert_int_equal(json_integer_value(json_object_get(message.parameters, "x")), 1);
	assert_true(message.more);
	assert_false(message.oneway);
	db_message_clear(&message);
	assert_null(message.root);
}

static void what_is_left_out_is_not_asked_for(void **state)
{
	struct db_message message;

	(void)state;
	assert_null(parse("{\"method\":\"a.B.C\"}", &message));
	assert_null(message.parameters);
	assert_false(message.more || message.oneway);
	db_message_clear(&message);
	assert_null(
		parse("{\"method\":\"a.B.C\",\"parameters\":null,\"more\":null,\"oneway\":true}",
	              &message));
	assert_null(message.parameters);
	assert_true(message.oneway);
	db_message_clear(&message);
}

static void what_is_wrong_is_named(void **state)
{
	static const struct {
		const char *text;
		const char *wrong;
	} cases[] = {
		{ "", "the message is no JSON object" },
		{ "{", "the message is no JSON object" },
		{ "{} {}", "the message is no JSON object" },
		{ "{\"method\":\"a\",\"method\":\"b\"}", "the message is no JSON object" },
		{ "{\"method\":\"\\u0000\"}", "the message is no JSON object" },
		{ "{\"method\":\"\xff\"}", "the message is no JSON object" },
		{ "[]", "method" },
		{ "{}", "method" },
		{ "{\"method\":1}", "method" },
		{ "{\"method\":\"a\",\"parameters\":[]}", "parameters" },
		{ "{\"method\":\"a\",\"more\":1}", "more" },
		{ "{\"method\":\"a\",\"oneway\":\"yes\"}", "oneway" },
		{ "{\"method\":\"a\",\"upgrade\":true}", "upgrade" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct db_message message;

		assert_string_equal(parse(cases[i].text, &message), cases[i].wrong);
		assert_null(message.root);
	}
}

static void nesting_without_end_is_refused(void **state)
{
	char text[DB_MESSAGE_MAX];
	struct db_message message;

	(void)state;
	memset(text, '[', sizeof text);
	assert_non_null(db_message_parse(text, sizeof text, &message));
	assert_null(message.root);
}

static void an_answer_is_one_message(void **state)
{
	size_t length = 0;
	char *text;

	(void)state;
	text = db_message_answer(NULL, NULL, false, &length);
	assert_string_equal(text, "{\"parameters\":{}}");
	assert_int_equal(length, strlen(text) + 1);
	free(text);
	text = db_message_answer("a.B.Busy", json_pack("{s:f}", "x", 0.1), false, &length);
	assert_string_equal(text, "{\"error\":\"a.B.Busy\",\"parameters\":{\"x\":0.1}}");
	free(text);
	text = db_message_answer(NULL, json_pack("{s:I}", "x", (json_int_t)UINT32_MAX), true,
	                         &length);
	assert_string_equal(text, "{\"parameters\":{\"x\":4294967295},\"continues\":true}");
	free(text);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_call_is_taken_apart),
		cmocka_unit_test(what_is_left_out_is_not_asked_for),
		cmocka_unit_test(what_is_wrong_is_named),
		cmocka_unit_test(nesting_without_end_is_refused),
		cmocka_unit_test(an_answer_is_one_message),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
