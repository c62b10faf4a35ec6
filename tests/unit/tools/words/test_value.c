/* SPDX-License-Identifier: Apache-2.0 */
#include "words/nearest.h"
#include "words/value.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static json_t *state_register(void)
{
	return json_pack("{s:s, s:s, s:{s:s, s:s, s:s}}", "name", "axis_state", "type", "u16",
	                 "codes", "0", "Offline", "2", "Standstill", "7", "error_stop");
}

static json_t *bits_register(void)
{
	return json_pack("{s:s, s:s, s:{s:s, s:s, s:s}}", "name", "status", "type", "bits32",
	                 "codes", "0", "online", "1", "enabled", "31", "last");
}

static json_t *velocity_register(void)
{
	return json_pack("{s:s, s:s, s:s, s:f, s:f}", "name", "target_velocity", "type", "f32",
	                 "unit", "counts/s", "min", -50000.0, "max", 50000.0);
}

static void expect_text(json_t *reg, json_t *value, const char *expected)
{
	char text[DB_WORDS_VALUE_MAX];

	db_words_write_value(reg, value, text, sizeof(text));
	assert_string_equal(text, expected);
	json_decref(reg);
	json_decref(value);
}

static void test_values_have_names_and_units(void **state)
{
	(void)state;
	expect_text(state_register(), json_integer(2), "Standstill");
	expect_text(state_register(), json_integer(9), "9");
	expect_text(bits_register(), json_integer(3), "online, enabled");
	expect_text(bits_register(), json_integer(0x80000005), "online, bit 2, last");
	expect_text(bits_register(), json_integer(0), "none");
	expect_text(velocity_register(), json_real(3200), "3200 counts/s");
	/* As few digits as a register of single precision needs. */
	expect_text(velocity_register(), json_real((double)0.1F), "0.1 counts/s");
	expect_text(velocity_register(), json_real((double)16777215.0F), "16777215 counts/s");
	expect_text(velocity_register(), json_null(), "-");
	expect_text(NULL, NULL, "-");
	expect_text(NULL, json_true(), "on");
}

static void test_texts_of_drives_do_not_move_the_cursor(void **state)
{
	(void)state;
	expect_text(NULL, json_string("VSMD\033[2J\n\x7f"), "VSMD?[2J??");
	expect_text(NULL,
	            json_string("\xc2\x9b"
	                        "2J \xc2\xb5m"),
	            "??2J \xc2\xb5m");
	/* Nor do they turn the text around. */
	expect_text(NULL, json_string("a\u202eb\u200e \u2069\u2066 \u2026 \u20ac"),
	            "a???b??? ?????? \u2026 \u20ac");
}

/* A text that was shortened within a letter ends there, and not somewhere after it. */
static void test_a_letter_cut_in_two_keeps_the_end_of_the_text(void **state)
{
	char text[] = "a\xc2\0b\x01";

	(void)state;
	db_words_clean(text);
	assert_memory_equal(text, "a\xc2\0b\x01", sizeof(text));
}

static void expect_parsed(json_t *reg, const char *text, json_int_t expected)
{
	char problem[256] = "";
	json_t *value = db_words_parse_value(reg, text, problem, sizeof(problem));

	assert_string_equal(problem, "");
	assert_int_equal((json_int_t)json_number_value(value), expected);
	json_decref(value);
	json_decref(reg);
}

static void expect_problem(json_t *reg, const char *text, const char *expected)
{
	char problem[256] = "";

	assert_null(db_words_parse_value(reg, text, problem, sizeof(problem)));
	assert_string_equal(problem, expected);
	json_decref(reg);
}

static void test_words_become_values(void **state)
{
	(void)state;
	expect_parsed(state_register(), "Standstill", 2);
	expect_parsed(state_register(), "standstill", 2);
	expect_parsed(state_register(), "error stop", 7);
	expect_parsed(state_register(), "2", 2);
	expect_parsed(bits_register(), "online,last", 0x80000001);
	expect_parsed(bits_register(), "online, last", 0x80000001);
	expect_parsed(bits_register(), "none", 0);
	expect_parsed(bits_register(), "0x3", 3);
	expect_parsed(velocity_register(), "-50000", -50000);
	expect_parsed(json_pack("{s:s}", "type", "i32"), "-2147483648", INT32_MIN);
}

static void test_what_is_wrong_is_said_with_what_would_be_right(void **state)
{
	(void)state;
	expect_problem(velocity_register(), "50001",
	               "50001 is out of range, -50000 to 50000 counts/s");
	expect_problem(velocity_register(), "fast",
	               "\"fast\" is no number; right is -50000 to 50000 counts/s");
	expect_problem(velocity_register(), "",
	               "\"\" is no number; right is -50000 to 50000 counts/s");
	expect_problem(velocity_register(), "nan", "nan is out of range, -50000 to 50000 counts/s");
	expect_problem(velocity_register(), "10x",
	               "\"10x\" is no number; right is -50000 to 50000 counts/s");
	expect_problem(state_register(), "Standing",
	               "\"Standing\" is no whole number; right is any, or a name of its codes");
	expect_problem(bits_register(), "online,of", "no bit is called \"of\"");
	expect_problem(json_pack("{s:s, s:i}", "type", "u16", "max", 9), "10",
	               "10 is out of range, at most 9");
	expect_problem(json_pack("{s:s}", "type", "bool"), "maybe",
	               "\"maybe\" is neither on nor off");
}

static void test_the_nearest_names_are_meant(void **state)
{
	json_t *list = json_pack("[{s:s}, {s:s}, {s:s}]", "name", "feeder", "name", "conveyor",
	                         "name", "feeder2");
	char text[128];

	(void)state;
	assert_int_equal(db_words_distance("feeder", "feeder"), 0);
	assert_int_equal(db_words_distance("fedeer", "feeder"), 1);
	assert_int_equal(db_words_distance("", "abc"), 3);
	db_words_nearest_names(list, "feder", text, sizeof(text));
	assert_string_equal(text, "; did you mean feeder or feeder2?");
	db_words_nearest_names(list, "x", text, sizeof(text));
	assert_string_equal(text, "; there are feeder, conveyor and feeder2");
	/* Never more than there is room for. */
	db_words_nearest_names(list, "x", text, 16);
	assert_string_equal(text, "; there are fee");
	json_decref(list);
}

static void expect_meaning(const char *description, json_t *value, const char *expected)
{
	json_t *reg = json_pack("{s:s, s:s}", "name", "mode", "type", "u16");
	char text[DB_WORDS_MEANING_MAX] = "";
	bool told = db_words_meaning(reg, description, value, text, sizeof(text));

	assert_int_equal(told, expected != NULL);
	if (expected)
		assert_string_equal(text, expected);
	json_decref(reg);
	json_decref(value);
}

static void test_descriptions_say_what_numbers_mean(void **state)
{
	const char *direction = "Direction: 0=against the motor 1=with the motor; closed loop only";

	(void)state;
	expect_meaning(direction, json_integer(0), "against the motor");
	expect_meaning(direction, json_real(1.0), "with the motor");
	expect_meaning(direction, json_integer(2), NULL);
	expect_meaning(direction, json_real(0.5), NULL);
	expect_meaning(direction, json_null(), NULL);
	expect_meaning("Age; 4294967295=never read", json_integer(4294967295), "never read");
	expect_meaning("Time; 10=long", json_integer(0), NULL);
	expect_meaning("Steps: 0=full 1=1/2 2=1/4", json_integer(1), "1/2");
	expect_meaning("Sensor: 0=none 1=s1 ... 6=s6", json_integer(1), "s1");
	expect_meaning("Sensor: 0=none 1=s1 ... 6=s6", json_integer(3), NULL);
	expect_meaning("Resistance: 0=", json_integer(0), NULL);
	expect_meaning("", json_integer(0), NULL);
}

static void test_bits_and_codes_have_names_of_their_own(void **state)
{
	json_t *zero = json_integer(0);
	json_t *reg = bits_register();
	char text[DB_WORDS_MEANING_MAX];

	(void)state;
	assert_false(db_words_meaning(reg, "Bits: 0=online", zero, text, sizeof(text)));
	json_decref(reg);
	reg = state_register();
	assert_false(db_words_meaning(reg, "State: 0=Offline", zero, text, sizeof(text)));
	json_decref(reg);
	json_decref(zero);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_descriptions_say_what_numbers_mean),
		cmocka_unit_test(test_bits_and_codes_have_names_of_their_own),
		cmocka_unit_test(test_values_have_names_and_units),
		cmocka_unit_test(test_texts_of_drives_do_not_move_the_cursor),
		cmocka_unit_test(test_a_letter_cut_in_two_keeps_the_end_of_the_text),
		cmocka_unit_test(test_words_become_values),
		cmocka_unit_test(test_what_is_wrong_is_said_with_what_would_be_right),
		cmocka_unit_test(test_the_nearest_names_are_meant),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
