/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/value.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <float.h>
#include <math.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static void names_and_registers(void **state)
{
	static const struct {
		enum db_type type;
		const char *name;
		unsigned registers;
	} rows[] = {
		{ DB_U16, "u16", 1 },   { DB_I16, "i16", 1 },       { DB_U32, "u32", 2 },
		{ DB_I32, "i32", 2 },   { DB_U64, "u64", 4 },       { DB_F32, "f32", 2 },
		{ DB_TEXT, "text", 0 }, { DB_BITS16, "bits16", 1 }, { DB_BITS32, "bits32", 2 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		assert_string_equal(db_type_name(rows[i].type), rows[i].name);
		assert_int_equal(db_type_registers(rows[i].type), rows[i].registers);
	}
}

static void whole_types_take_their_range(void **state)
{
	static const struct {
		enum db_type type;
		double min;
		double max;
	} rows[] = {
		{ DB_U16, 0, 65535 },        { DB_BITS16, 0, 65535 },
		{ DB_I16, -32768, 32767 },   { DB_I32, -2147483648.0, 2147483647.0 },
		{ DB_U32, 0, 4294967295.0 }, { DB_BITS32, 0, 4294967295.0 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		union db_value value = { .u = 77 };
		enum db_type type = rows[i].type;

		assert_false(db_value_from_number(type, rows[i].min - 1, &value));
		assert_false(db_value_from_number(type, rows[i].max + 1, &value));
		assert_false(db_value_from_number(type, rows[i].min - 0.5, &value));
		assert_false(db_value_from_number(type, rows[i].max + 0.5, &value));
		assert_false(db_value_from_number(type, 0.5, &value));
		assert_false(db_value_from_number(type, (double)NAN, &value));
		assert_false(db_value_from_number(type, (double)INFINITY, &value));
		assert_false(db_value_from_number(type, -(double)INFINITY, &value));
		assert_int_equal(value.u, 77);

		assert_true(db_value_from_number(type, rows[i].min, &value));
		assert_true(db_value_number(type, value) == rows[i].min);
		assert_true(db_value_from_number(type, rows[i].max, &value));
		assert_true(db_value_number(type, value) == rows[i].max);
		assert_true(db_value_from_number(type, 12800.0, &value));
		assert_true(db_value_number(type, value) == 12800.0);
	}
}

static void negative_zero_is_zero(void **state)
{
	union db_value value = { .u = 77 };

	(void)state;
	assert_true(db_value_from_number(DB_U16, -0.0, &value));
	assert_int_equal(value.u, 0);
	assert_true(db_value_from_number(DB_I32, -0.0, &value));
	assert_int_equal(value.i, 0);
}

static void floats_take_the_nearest(void **state)
{
	union db_value value = { .f = 7.0f };

	(void)state;
	assert_true(db_value_from_number(DB_F32, 0.1, &value));
	assert_true(value.f == 0.1f);
	assert_true(db_value_number(DB_F32, value) == (double)0.1f);
	assert_true(db_value_from_number(DB_F32, 16777217.0, &value));
	assert_true(value.f == 16777216.0f);
	assert_true(db_value_from_number(DB_F32, (double)FLT_MAX, &value));
	assert_true(value.f == FLT_MAX);
	assert_true(db_value_from_number(DB_F32, -(double)FLT_MAX, &value));
	assert_true(value.f == -FLT_MAX);
}

static void floats_refuse_what_does_not_fit(void **state)
{
	union db_value value = { .f = 7.0f };

	(void)state;
	assert_false(db_value_from_number(DB_F32, 2.0 * (double)FLT_MAX, &value));
	assert_false(db_value_from_number(DB_F32, DBL_MAX, &value));
	assert_false(db_value_from_number(DB_F32, (double)NAN, &value));
	assert_false(db_value_from_number(DB_F32, (double)INFINITY, &value));
	assert_false(db_value_from_number(DB_F32, -(double)INFINITY, &value));
	assert_true(value.f == 7.0f);
}

/* U64 and TEXT have no place in a db_value. */
static void wide_types_are_refused(void **state)
{
	union db_value value = { .u = 77 };

	(void)state;
	assert_false(db_value_from_number(DB_U64, 1.0, &value));
	assert_false(db_value_from_number(DB_TEXT, 1.0, &value));
	assert_int_equal(value.u, 77);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(names_and_registers),
		cmocka_unit_test(whole_types_take_their_range),
		cmocka_unit_test(negative_zero_is_zero),
		cmocka_unit_test(floats_take_the_nearest),
		cmocka_unit_test(floats_refuse_what_does_not_fit),
		cmocka_unit_test(wide_types_are_refused),
	};

	return cmocka_run_group_tests_name("codec/value", tests, NULL, NULL);
}
