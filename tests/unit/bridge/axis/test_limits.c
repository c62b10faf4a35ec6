/* SPDX-License-Identifier: Apache-2.0 */
/* Limits of the configuration, with what may be known of a drive. */
#include "axis/axis_private.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

/* -5 to 100 units, 20 units per second, 40 per second squared; ten counts a unit. */
static const struct db_drive_config DRIVE = {
	.counts_per_unit = 10.0,
	.min_position = -5.0,
	.max_position = 100.0,
	.max_velocity = 20.0,
	.max_acceleration = 40.0,
};

/* Nothing was told: as configured, and a velocity counts positions per second. */
static const struct db_limit_facts UNTOLD = { .has_preset = false };

static enum db_limit judge(enum db_command command, int32_t position, float velocity,
                           const struct db_limit_facts *facts)
{
	const struct db_args args = { .target_position = position, .target_velocity = velocity };

	return db_limits_command(&DRIVE, command, &args, facts);
}

static void a_limit_itself_is_permitted(void **state)
{
	(void)state;
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, 1000, 200.0f, &UNTOLD), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, 1001, 200.0f, &UNTOLD), DB_LIMIT_MAX_POSITION);
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, -50, -200.0f, &UNTOLD), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, -51, 1.0f, &UNTOLD), DB_LIMIT_MIN_POSITION);
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, 200.5f, &UNTOLD), DB_LIMIT_MAX_VELOCITY);
	assert_int_equal(db_limits_acceleration(&DRIVE, 400.0, &UNTOLD), DB_LIMIT_NONE);
	assert_int_equal(db_limits_acceleration(&DRIVE, 400.5, &UNTOLD), DB_LIMIT_MAX_ACCELERATION);
	assert_int_equal(db_limits_acceleration(&DRIVE, -400.5, &UNTOLD),
	                 DB_LIMIT_MAX_ACCELERATION);
	assert_true(fabs(db_limits_allowed(&DRIVE, &UNTOLD).max_velocity - 200.0) < 1e-9);
}

static void what_the_drive_tells_counts(void **state)
{
	const struct db_limit_facts facts = { .counts = 640.0, .velocity_counts = 2.0 };

	(void)state;
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, 64000, 6400.0f, &facts), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, 64001, 6400.0f, &facts),
	                 DB_LIMIT_MAX_POSITION);
	assert_int_equal(judge(DB_CMD_MOVE_ABSOLUTE, 0, 6401.0f, &facts), DB_LIMIT_MAX_VELOCITY);
	assert_int_equal(db_limits_acceleration(&DRIVE, 25600.0, &facts), DB_LIMIT_NONE);
	assert_int_equal(db_limits_acceleration(&DRIVE, 25601.0, &facts),
	                 DB_LIMIT_MAX_ACCELERATION);
	assert_true(fabs(db_limits_allowed(&DRIVE, &facts).max_velocity - 6400.0) < 1e-9);
}

/* While its scale is not known, whatever is limited is refused, and nothing else. */
static void an_unknown_scale_breaks_what_is_limited(void **state)
{
	const struct db_limit_facts facts = { .scale_open = true, .position = 20 };
	struct db_drive_config drive = DRIVE;
	const struct db_args args = { .target_velocity = 1.0f };

	(void)state;
	assert_int_equal(db_limits_command(&drive, DB_CMD_MOVE_VELOCITY, &args, &facts),
	                 DB_LIMIT_MAX_VELOCITY);
	assert_int_equal(db_limits_acceleration(&drive, 1.0, &facts), DB_LIMIT_MAX_ACCELERATION);
	assert_true(isnan(db_limits_allowed(&drive, &facts).max_velocity));
	drive.max_velocity = NAN;
	assert_int_equal(db_limits_command(&drive, DB_CMD_MOVE_VELOCITY, &args, &facts),
	                 DB_LIMIT_MIN_POSITION);
	drive.min_position = NAN;
	assert_int_equal(db_limits_command(&drive, DB_CMD_MOVE_VELOCITY, &args, &facts),
	                 DB_LIMIT_MAX_POSITION);
	drive.max_position = NAN;
	assert_int_equal(db_limits_command(&drive, DB_CMD_MOVE_VELOCITY, &args, &facts),
	                 DB_LIMIT_NONE);
	drive.max_acceleration = NAN;
	assert_int_equal(db_limits_acceleration(&drive, 1.0, &facts), DB_LIMIT_NONE);
}

/* Both ends of it, in whichever order. */
static void a_shake_stays_within_the_limits(void **state)
{
	static const struct {
		int32_t from;
		int32_t to;
		enum db_limit limit;
	} cases[] = {
		{ -50, 1000, DB_LIMIT_NONE },       { 1000, -50, DB_LIMIT_NONE },
		{ -51, 0, DB_LIMIT_MIN_POSITION },  { 0, -51, DB_LIMIT_MIN_POSITION },
		{ 1001, 0, DB_LIMIT_MAX_POSITION }, { 0, 1001, DB_LIMIT_MAX_POSITION },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const struct db_args args = { .shake_start_position = cases[i].from,
			                      .shake_end_position = cases[i].to };

		assert_int_equal(db_limits_command(&DRIVE, DB_CMD_SHAKE_START, &args, &UNTOLD),
		                 cases[i].limit);
		assert_int_equal(db_limits_command(&DRIVE, DB_CMD_SHAKE_START_TIME, &args, &UNTOLD),
		                 cases[i].limit);
	}
}

/* Beyond a limit the way back is free, and standing still. */
static void the_way_back_is_free(void **state)
{
	struct db_limit_facts facts = { .has_preset = true, .preset_velocity = 10.0f };

	(void)state;
	facts.position = 1200;
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, 1.0f, &facts), DB_LIMIT_MAX_POSITION);
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, -1.0f, &facts), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, 0.0f, &facts), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_JOG_POSITIVE, 0, 0.0f, &facts), DB_LIMIT_MAX_POSITION);
	assert_int_equal(judge(DB_CMD_JOG_NEGATIVE, 0, 0.0f, &facts), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_MOVE_RELATIVE, -201, 1.0f, &facts), DB_LIMIT_NONE);
	facts.position = -60;
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, -1.0f, &facts), DB_LIMIT_MIN_POSITION);
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, 1.0f, &facts), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_MOVE_VELOCITY, 0, 0.0f, &facts), DB_LIMIT_NONE);
	assert_int_equal(judge(DB_CMD_JOG_NEGATIVE, 0, 0.0f, &facts), DB_LIMIT_MIN_POSITION);
	assert_int_equal(judge(DB_CMD_JOG_POSITIVE, 0, 0.0f, &facts), DB_LIMIT_NONE);
}

static void limits_have_names(void **state)
{
	(void)state;
	assert_string_equal(db_limit_name(DB_LIMIT_NONE), "none");
	assert_string_equal(db_limit_name(DB_LIMIT_MAX_ACCELERATION), "max_acceleration");
	assert_string_equal(db_limit_name(DB_LIMIT_COUNT), "unknown");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_limit_itself_is_permitted),
		cmocka_unit_test(what_the_drive_tells_counts),
		cmocka_unit_test(an_unknown_scale_breaks_what_is_limited),
		cmocka_unit_test(a_shake_stays_within_the_limits),
		cmocka_unit_test(the_way_back_is_free),
		cmocka_unit_test(limits_have_names),
	};

	return cmocka_run_group_tests_name("axis/limits", tests, NULL, NULL);
}
