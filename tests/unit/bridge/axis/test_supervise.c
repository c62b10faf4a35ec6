/* SPDX-License-Identifier: Apache-2.0 */
/* A simulated axis that is jogged towards its limits, looked at now and then. */
#include "axis/axis_private.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

struct axis {
	double position;
	double velocity;
	double wanted;
	double ramp; /* units/s^2 */
	db_time now;
	db_time hears_at; /* a stop; NEVER */
	struct db_feedback feedback;
};

/* The drive's data are a cycle old at most, and a stop needs 10 ms. */
static const struct db_supervise_config CONFIG = {
	.min = -1000,
	.max = 1000,
	.velocity_counts = 1,
	.delay = 50 * MS,
};

static void advance(struct axis *axis)
{
	double change = axis->ramp / 1000.0;

	axis->now += MS;
	if (axis->now >= axis->hears_at)
		axis->wanted = 0.0;
	if (fabs(axis->wanted - axis->velocity) <= change)
		axis->velocity = axis->wanted;
	else
		axis->velocity += copysign(change, axis->wanted - axis->velocity);
	axis->position += axis->velocity / 1000.0;
	if (axis->now % (20 * MS) != 0)
		return;
	axis->feedback.taken = axis->now;
	axis->feedback.position = (int32_t)axis->position;
	axis->feedback.velocity = (float)axis->velocity;
	axis->feedback.status = axis->velocity != 0.0 ? DB_STATUS_ONLINE | DB_STATUS_MOVING :
	                                                DB_STATUS_ONLINE;
}

/* Jogs until it stands. The limit that stopped it. */
static enum db_limit jog(struct db_supervise *supervise, const struct db_supervise_config *config,
                         struct axis *axis, double velocity)
{
	enum db_limit found = DB_LIMIT_NONE;

	axis->wanted = velocity;
	axis->hears_at = DB_TIME_NEVER;
	db_supervise_begin(supervise, axis->now);
	for (unsigned i = 0; i < 300000 && supervise->active; i++) {
		enum db_limit limit;

		advance(axis);
		if (axis->now % (5 * MS) != 0)
			continue;
		limit = db_supervise_check(supervise, config, &axis->feedback, axis->now);
		if (limit == DB_LIMIT_NONE)
			continue;
		assert_int_equal(found, DB_LIMIT_NONE); /* said once */
		found = limit;
		db_supervise_stop(supervise, config, &axis->feedback, axis->now);
		axis->hears_at = axis->now + 10 * MS;
	}
	assert_false(supervise->active);
	return found;
}

static void a_jog_does_not_pass_a_limit(void **state)
{
	static const double ramps[] = { 200, 1000, 100000 };
	static const double speeds[] = { 20, 300, 900 };

	(void)state;
	for (size_t r = 0; r < sizeof ramps / sizeof ramps[0]; r++) {
		for (size_t s = 0; s < sizeof speeds / sizeof speeds[0]; s++) {
			struct db_supervise_config config = CONFIG;
			struct db_supervise supervise = { .active = false };
			struct axis axis = { .ramp = ramps[r], .now = MS };

			config.deceleration = ramps[r];
			assert_int_equal(jog(&supervise, &config, &axis, speeds[s]),
			                 DB_LIMIT_MAX_POSITION);
			assert_true(axis.position <= 1000.0);
			/* And not much too early: what passes in the delay, and a cycle's growth. */
			assert_true(axis.position >= 1000.0 - speeds[s] * 0.2 - 1.0);
			assert_int_equal(jog(&supervise, &config, &axis, -speeds[s]),
			                 DB_LIMIT_MIN_POSITION);
			assert_true(axis.position >= -1000.0);
		}
	}
}

/* Nobody knows how it brakes: the first time it may go too far, and not again. */
static void brakes_are_measured(void **state)
{
	struct db_supervise supervise = { .active = false };
	struct axis axis = { .ramp = 400, .now = MS };

	(void)state;
	jog(&supervise, &CONFIG, &axis, 800);
	assert_true(axis.position > 1000.0);
	assert_true(supervise.measured > 0.0);
	jog(&supervise, &CONFIG, &axis, -700);
	assert_true(axis.position >= -1000.0);
	jog(&supervise, &CONFIG, &axis, 850);
	assert_true(axis.position <= 1000.0);
}

/* From beyond a limit the way back is free, and what has no limits is left alone. */
static void the_way_back_is_free(void **state)
{
	struct db_supervise_config none = CONFIG;
	struct db_supervise supervise = { .active = false };
	struct axis axis = { .ramp = 1000, .now = MS, .position = 1500 };

	(void)state;
	assert_int_equal(jog(&supervise, &CONFIG, &axis, -300), DB_LIMIT_MIN_POSITION);
	assert_true(axis.position < -800.0);
	none.min = none.max = NAN;
	axis.wanted = 300;
	axis.hears_at = DB_TIME_NEVER;
	db_supervise_begin(&supervise, axis.now);
	for (unsigned i = 0; i < 30000; i++) {
		advance(&axis);
		assert_int_equal(db_supervise_check(&supervise, &none, &axis.feedback, axis.now),
		                 DB_LIMIT_NONE);
	}
	assert_true(axis.position > 2000.0);
}

/* It was stopped there, and something sets it off again. */
static void what_starts_again_is_stopped_again(void **state)
{
	struct db_supervise supervise = { .active = false };
	struct db_feedback feedback = { .position = 990, .velocity = 300.0f };
	db_time now = 10 * MS;

	(void)state;
	db_supervise_begin(&supervise, 0);
	for (unsigned i = 0; i < 3; i++) {
		feedback.taken = now += 20 * MS;
		feedback.status = DB_STATUS_ONLINE | DB_STATUS_MOVING;
		assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, now),
		                 DB_LIMIT_MAX_POSITION);
		feedback.taken = now += 20 * MS;
		assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, now),
		                 DB_LIMIT_NONE);
		feedback.status = DB_STATUS_ONLINE;
		feedback.taken = now += 900 * MS;
		assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, now),
		                 DB_LIMIT_NONE);
		assert_true(supervise.active);
	}
	feedback.taken = now += 100 * MS;
	(void)db_supervise_check(&supervise, &CONFIG, &feedback, now);
	assert_false(supervise.active);
}

/* By the next check it is as much faster as since the last one. */
static void a_drive_that_gets_faster_is_stopped_sooner(void **state)
{
	struct db_feedback feedback = { .status = DB_STATUS_ONLINE | DB_STATUS_MOVING,
		                        .taken = 10 * MS,
		                        .position = 900,
		                        .velocity = 100.0f };
	struct db_supervise supervise = { .active = false };

	(void)state;
	db_supervise_begin(&supervise, 0);
	assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, 10 * MS),
	                 DB_LIMIT_NONE);
	feedback.taken = 30 * MS;
	feedback.position = 950;
	feedback.velocity = 600.0f;
	assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, 30 * MS),
	                 DB_LIMIT_MAX_POSITION);
	/* At this speed all the time it would be in time later, and so would one that brakes. */
	for (unsigned i = 0; i < 2; i++) {
		db_supervise_begin(&supervise, 0);
		supervise.last_taken = 0;
		feedback.taken = 10 * MS;
		feedback.velocity = i == 0 ? 600.0f : 1000.0f;
		feedback.position = 900;
		supervise.last_speed = feedback.velocity;
		assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, 10 * MS),
		                 DB_LIMIT_NONE);
		feedback.taken = 30 * MS;
		feedback.position = 950;
		feedback.velocity = 600.0f;
		assert_int_equal(db_supervise_check(&supervise, &CONFIG, &feedback, 30 * MS),
		                 DB_LIMIT_NONE);
	}
}

/* From the first stop of a motion that moves, to where it stands. */
static void only_a_moving_motion_is_measured(void **state)
{
	struct db_feedback feedback = { .status = DB_STATUS_ONLINE | DB_STATUS_MOVING,
		                        .taken = 10 * MS,
		                        .position = 100,
		                        .velocity = 100.0f };
	struct db_supervise supervise = { .active = false };

	(void)state;
	db_supervise_stop(&supervise, &CONFIG, &feedback, 10 * MS);
	assert_false(supervise.measuring);
	db_supervise_begin(&supervise, 0);
	feedback.velocity = 0.0f;
	db_supervise_stop(&supervise, &CONFIG, &feedback, 10 * MS);
	assert_false(supervise.measuring);
	feedback.velocity = 100.0f;
	db_supervise_stop(&supervise, &CONFIG, &feedback, 10 * MS);
	assert_true(supervise.measuring);
	/* Another stop while it brakes. */
	feedback.position = 120;
	feedback.velocity = 50.0f;
	db_supervise_stop(&supervise, &CONFIG, &feedback, 10 * MS);
	feedback.status = DB_STATUS_ONLINE;
	feedback.position = 150;
	feedback.velocity = 0.0f;
	feedback.taken = 500 * MS;
	(void)db_supervise_check(&supervise, &CONFIG, &feedback, 500 * MS);
	assert_false(supervise.measuring);
	/* 50 counts from 100 counts/s. */
	assert_true(fabs(supervise.measured - 50.0 / 10000.0) < 1e-9);
}

static void only_motions_without_a_target_are_watched(void **state)
{
	(void)state;
	assert_true(db_supervise_applies(DB_CMD_JOG_POSITIVE));
	assert_true(db_supervise_applies(DB_CMD_JOG_NEGATIVE));
	assert_true(db_supervise_applies(DB_CMD_MOVE_VELOCITY));
	assert_true(db_supervise_applies(DB_CMD_MOVE_PRESET));
	assert_true(db_supervise_applies(DB_CMD_MOVE_CURRENT));
	assert_false(db_supervise_applies(DB_CMD_MOVE_ABSOLUTE));
	assert_false(db_supervise_applies(DB_CMD_HOME));
	assert_false(db_supervise_applies(DB_CMD_START_PROGRAM));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_jog_does_not_pass_a_limit),
		cmocka_unit_test(brakes_are_measured),
		cmocka_unit_test(the_way_back_is_free),
		cmocka_unit_test(what_starts_again_is_stopped_again),
		cmocka_unit_test(a_drive_that_gets_faster_is_stopped_sooner),
		cmocka_unit_test(only_a_moving_motion_is_measured),
		cmocka_unit_test(only_motions_without_a_target_are_watched),
	};

	return cmocka_run_group_tests_name("axis/supervise", tests, NULL, NULL);
}
