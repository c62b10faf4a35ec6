/* SPDX-License-Identifier: Apache-2.0 */
/* What the readings after a command prove: that it had its effect, nothing yet, or nothing that an
 * older motion would not explain, too. */
#include "driver/vsmd/vsmd_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define STANDS (VSMD_ST_PWR | VSMD_ST_STP)
#define RUNS VSMD_ST_PWR

#define SHOWN VSMD_EFFECT_SHOWN
#define OPEN VSMD_EFFECT_OPEN
#define ABSENT VSMD_EFFECT_ABSENT

#define UNKNOWN                           \
	{                                 \
		.kind = VSMD_GOAL_UNKNOWN \
	}
#define REST                           \
	{                              \
		.kind = VSMD_GOAL_REST \
	}
#define SPEED(value)                                            \
	{                                                       \
		.kind = VSMD_GOAL_VELOCITY, .velocity = (value) \
	}
#define PLACE(value)                                            \
	{                                                       \
		.kind = VSMD_GOAL_POSITION, .position = (value) \
	}

static enum vsmd_effect judge(const struct vsmd_axis *axis, enum db_command command,
                              struct db_args args)
{
	const struct db_request request = { .command = command, .args = &args };
	const struct db_job job = { .kind = DB_JOB_COMMAND, .request = &request };

	return vsmd_effect_of(axis, &job);
}

static enum vsmd_effect judge_velocity(const struct vsmd_axis *axis, float wanted)
{
	return judge(axis, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = wanted });
}

static enum vsmd_effect judge_target(struct vsmd_axis *axis, int32_t target)
{
	axis->wanted = target;
	return judge(axis, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = target });
}

/* One that moved before the command and still does. Its speeds: before the command, first read
 * after it, and now. */
static struct vsmd_axis moving(struct vsmd_goal goal, float before, float first, float now)
{
	return (struct vsmd_axis){
		.watch = { .before = { .moving = true, .velocity = before, .goal = goal },
		           .has_speed = true,
		           .first_speed = first,
		           .speed = now,
		           .has_place = true },
		.last = { .velocity = now, .status = RUNS },
	};
}

/* One that tells no speed: by its way since the command, and what it was told before. */
static void a_way_proves_only_another_direction(void **state)
{
	static const struct {
		struct vsmd_goal goal;
		int32_t before; /* where it was when it was told */
		int32_t way;
		float wanted;
		enum vsmd_effect effect;
	} cases[] = {
		{ SPEED(3000.0f), 0, -100, -3000.0f, SHOWN },
		{ SPEED(3000.0f), 0, 100, -3000.0f, ABSENT },
		{ SPEED(3000.0f), 0, 100, 4000.0f, ABSENT },
		{ SPEED(0.0f), 0, 100, 3000.0f, OPEN },
		{ SPEED(0.0f), 0, -100, -3000.0f, OPEN },
		{ PLACE(900), 100, -100, -3000.0f, SHOWN },
		{ PLACE(900), 100, 100, 3000.0f, ABSENT },
		{ PLACE(-50), 100, 100, 3000.0f, SHOWN },
		{ UNKNOWN, 100, -100, -3000.0f, OPEN },
		{ UNKNOWN, 100, 100, 3000.0f, OPEN },
		/* Two counts beside in-position-window are no way yet. */
		{ SPEED(-3000.0f), 0, 12, 3000.0f, ABSENT },
		{ SPEED(-3000.0f), 0, 13, 3000.0f, SHOWN },
		{ SPEED(-3000.0f), 0, 0, 3000.0f, ABSENT },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving(cases[i].goal, 0.0f, 0.0f, 0.0f);

		axis.window = 10.0;
		axis.watch.before.position = cases[i].before;
		axis.watch.first_place = cases[i].before;
		axis.last.position = cases[i].before + cases[i].way;
		assert_int_equal(judge_velocity(&axis, cases[i].wanted), cases[i].effect);
		/* No place was read since, so there is no way. */
		axis.watch.has_place = false;
		assert_int_equal(judge_velocity(&axis, cases[i].wanted), ABSENT);
	}
}

/* A speed is told without its sign until one below 0 was seen; then its sign counts. */
static void the_way_gives_the_sign_of_a_drive_that_tells_none(void **state)
{
	static const struct {
		float before;
		float first;
		enum vsmd_effect effect;
	} cases[] = {
		{ 0.0f, 100.0f, OPEN },    { 100.0f, 0.0f, OPEN },    { 0.0f, 0.0f, OPEN },
		{ -5.0f, 100.0f, ABSENT }, { 100.0f, -5.0f, ABSENT }, { -5.0f, -5.0f, ABSENT },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving((struct vsmd_goal)UNKNOWN, cases[i].before,
		                               cases[i].first, 3000.0f);

		axis.last.position = -100;
		assert_int_equal(judge_velocity(&axis, -3000.0f), cases[i].effect);
	}
}

/* Told again what it does already, as near as two speeds are the same: 1 count per second and 1 %. */
static void the_same_speed_again_is_there_at_once(void **state)
{
	struct vsmd_axis axis = moving((struct vsmd_goal)SPEED(98.0f), 98.0f, 98.0f, 98.0f);

	(void)state;
	axis.watch.has_speed = false;
	assert_int_equal(judge_velocity(&axis, 100.0f), SHOWN);
	assert_int_equal(judge_velocity(&axis, 101.0f), ABSENT);
	/* What it was not told it does not do: it goes to a place, and is to stop. */
	axis = moving((struct vsmd_goal)PLACE(9000), 3000.0f, 3000.0f, 3000.0f);
	assert_int_equal(judge_velocity(&axis, 0.0f), ABSENT);
}

/* Rounding is no change of speed; 0.5 and a thousandth of it are. */
static void a_speed_has_changed_when_rounding_does_not_explain_it(void **state)
{
	static const struct {
		float now;
		float wanted;
		enum vsmd_effect effect;
	} cases[] = {
		{ 1001.0f, 2000.0f, ABSENT }, { 1003.0f, 2000.0f, SHOWN },
		{ 998.5f, 0.0f, ABSENT },     { 998.25f, 0.0f, OPEN }, /* its own speed, rounded */
		{ 997.0f, 0.0f, SHOWN },      { 997.0f, 2000.0f, ABSENT },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving((struct vsmd_goal)SPEED(1000.0f), 1000.0f, 1000.0f,
		                               cases[i].now);

		assert_int_equal(judge_velocity(&axis, cases[i].wanted), cases[i].effect);
	}
}

/* Of a speed between that before and that of the older command nobody knows which of the two
 * commands made it. */
static void a_speed_on_the_older_way_is_open(void **state)
{
	static const struct {
		struct vsmd_goal goal;
		float before;
		float now;
		float wanted;
		enum vsmd_effect effect;
	} cases[] = {
		{ SPEED(1000.0f), 1000.0f, 998.0f, 0.0f, OPEN },
		{ SPEED(1000.0f), 1000.0f, 997.75f, 0.0f, SHOWN },
		{ SPEED(-1000.0f), -1000.0f, -998.0f, 0.0f, OPEN },
		{ SPEED(-1000.0f), -1000.0f, -997.75f, 0.0f, SHOWN },
		{ REST, 1000.0f, 500.0f, -1000.0f, OPEN },
		{ REST, 1000.0f, -500.0f, -1000.0f, SHOWN },
		{ UNKNOWN, 1000.0f, -500.0f, -1000.0f, OPEN },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving(cases[i].goal, cases[i].before, cases[i].before,
		                               cases[i].now);

		assert_int_equal(judge_velocity(&axis, cases[i].wanted), cases[i].effect);
	}
}

/* A move with speed 0 has its effect when it stands, another one when it does not. */
static void a_speed_of_0_is_a_stand(void **state)
{
	struct vsmd_axis axis = moving((struct vsmd_goal)UNKNOWN, 1000.0f, 1000.0f, 0.0f);

	(void)state;
	axis.last.status = STANDS;
	assert_int_equal(judge_velocity(&axis, 0.0f), SHOWN);
	assert_int_equal(judge_velocity(&axis, 5.0f), ABSENT);
	assert_int_equal(judge_velocity(&axis, -5.0f), ABSENT);
	/* It stood before. */
	axis.watch.before.moving = false;
	axis.last.status = RUNS;
	assert_int_equal(judge_velocity(&axis, 0.0f), ABSENT);
	assert_int_equal(judge_velocity(&axis, 5.0f), SHOWN);
	assert_int_equal(judge_velocity(&axis, -5.0f), SHOWN);
}

/* The same of the speed that the drive has itself; where that is not known only a motion shows. */
static void a_preset_speed_is_judged_where_it_is_known(void **state)
{
	struct vsmd_axis axis = moving((struct vsmd_goal)SPEED(3000.0f), 3000.0f, 3000.0f, 3000.0f);
	const struct db_args none = { 0 };

	(void)state;
	DB_NAMEPLATE_INIT(&axis.plate, &axis.plate_room, VSMD_PARAM_COUNT);
	assert_int_equal(judge(&axis, DB_CMD_MOVE_PRESET, none), OPEN);
	axis.plate.values[VSMD_SPD].f = 3000.0f;
	axis.plate.valid[0] = UINT64_C(1) << VSMD_SPD;
	assert_int_equal(judge(&axis, DB_CMD_MOVE_PRESET, none), SHOWN);
	axis.plate.values[VSMD_SPD].f = 6400.0f;
	assert_int_equal(judge(&axis, DB_CMD_MOVE_PRESET, none), ABSENT);
	axis.plate.doubtful = true;
	assert_int_equal(judge(&axis, DB_CMD_MOVE_PRESET, none), OPEN);
	axis.watch.before.moving = false;
	assert_int_equal(judge(&axis, DB_CMD_MOVE_PRESET, none), SHOWN);
	axis.last.status = STANDS;
	assert_int_equal(judge(&axis, DB_CMD_MOVE_PRESET, none), ABSENT);
}

/* A target is on the way when the drive heads there, and its own when nothing older explains that. */
static void a_new_target_is_headed_for(void **state)
{
	static const struct {
		struct vsmd_goal goal;
		float before;
		float now;
		int32_t target; /* it is at 500 */
		enum vsmd_effect effect;
	} cases[] = {
		/* From an older run away from its target it turns to that: to the new one, too. */
		{ PLACE(900), -100.0f, 50.0f, 2000, OPEN },
		{ PLACE(900), -100.0f, 50.0f, 100, ABSENT },
		{ PLACE(900), -100.0f, -95.0f, 100, OPEN },
		/* Faster, and away from the older target: that is the new one. */
		{ PLACE(900), -100.0f, -105.0f, 100, SHOWN },
		{ PLACE(900), 100.0f, -50.0f, 100, SHOWN },
		{ PLACE(900), 100.0f, 100.0f, 900, SHOWN },
		/* It slows down to turn; faster in the wrong direction, or as fast, it does not. */
		{ UNKNOWN, 1000.0f, 900.0f, 100, OPEN },
		{ UNKNOWN, 1000.0f, 1100.0f, 100, ABSENT },
		{ UNKNOWN, 1000.0f, 1000.0f, 100, ABSENT },
		{ UNKNOWN, 1000.0f, -900.0f, 900, ABSENT },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving(cases[i].goal, cases[i].before, cases[i].before,
		                               cases[i].now);

		axis.last.position = axis.watch.first_place = 500;
		/* One that tells signs: its way gives none. */
		assert_int_equal(judge_target(&axis, cases[i].target), cases[i].effect);
	}
}

/* 125 ms pass. What was set shows when it is farther than the drive can have come meanwhile: at twice
 * its highest speed, within in-position-window, and 1 count. */
static void a_set_position_is_farther_than_any_way(void **state)
{
	static const struct {
		struct vsmd_goal goal;
		int32_t before;
		int32_t now;
		enum vsmd_effect effect; /* of 1000 */
	} cases[] = {
		{ UNKNOWN, 0, 1036, SHOWN },        { UNKNOWN, 0, 1037, ABSENT },
		{ UNKNOWN, 0, 964, SHOWN },         { UNKNOWN, 0, 963, ABSENT },
		{ UNKNOWN, 1000, 1036, OPEN },      { UNKNOWN, 999, 1036, SHOWN },
		{ UNKNOWN, -1010, 1010, SHOWN },    { SPEED(800.0f), 0, 1211, SHOWN },
		{ SPEED(800.0f), 0, 1212, ABSENT }, { SPEED(50.0f), 0, 1036, SHOWN },
		{ SPEED(50.0f), 0, 1037, ABSENT },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving(cases[i].goal, 50.0f, 50.0f, 100.0f);
		const struct db_args args = { .target_position = 1000 };

		axis.window = 10.0;
		axis.watch.before.position = cases[i].before;
		axis.watch.before.at = 1000 * MS;
		axis.status_at = 1125 * MS;
		axis.last.position = cases[i].now;
		assert_int_equal(judge(&axis, DB_CMD_SET_POSITION, args), cases[i].effect);
		/* It has come to a stand meanwhile. */
		axis.last.status = STANDS;
		assert_int_equal(judge(&axis, DB_CMD_SET_POSITION, args), cases[i].effect);
		/* It has begun to move meanwhile. */
		axis.last.status = RUNS;
		axis.watch.before.moving = false;
		assert_int_equal(judge(&axis, DB_CMD_SET_POSITION, args), cases[i].effect);
	}
}

/* One that stood is where it was set, and nowhere else. */
static void a_set_position_of_a_standing_drive_is_its_place(void **state)
{
	struct vsmd_axis axis = moving((struct vsmd_goal)REST, 0.0f, 0.0f, 0.0f);
	const struct db_args args = { .target_position = 1000 };

	(void)state;
	axis.watch.before.moving = false;
	axis.last.status = STANDS;
	axis.last.position = 1000;
	assert_int_equal(judge(&axis, DB_CMD_SET_POSITION, args), SHOWN);
	axis.last.position = 1001;
	assert_int_equal(judge(&axis, DB_CMD_SET_POSITION, args), ABSENT);
}

/* An output has its level when that shows. What is an input shows the level of its signal: only one
 * that has followed proves anything. */
static void an_input_proves_a_level_only_by_following(void **state)
{
	static const uint32_t bits[] = { VSMD_ST_S1, VSMD_ST_S2, VSMD_ST_S3,
		                         VSMD_ST_S4, VSMD_ST_S5, VSMD_ST_S6 };

	(void)state;
	for (unsigned i = 0; i < 4 * 6; i++) {
		unsigned port = i / 4 + 1;
		uint32_t bit = bits[port - 1];
		bool was = i & 1;
		bool high = i & 2;
		struct vsmd_axis axis = moving((struct vsmd_goal)REST, 0.0f, 0.0f, 0.0f);
		const struct db_args args = { .output_number = (uint16_t)port,
			                      .output_value = high };

		DB_NAMEPLATE_INIT(&axis.plate, &axis.plate_room, VSMD_PARAM_COUNT);
		axis.plate.valid[0] = UINT64_C(1) << (VSMD_S1 + port - 1);
		axis.watch.before.status = STANDS | (was ? bit : 0);
		for (unsigned output = 0; output < 2; output++) {
			axis.plate.values[VSMD_S1 + port - 1].u = output;
			axis.last.status = STANDS | (high ? bit : 0);
			assert_int_equal(judge(&axis, DB_CMD_SET_OUTPUT, args),
			                 output || was != high ? SHOWN : ABSENT);
			axis.last.status = STANDS | (high ? 0 : bit);
			assert_int_equal(judge(&axis, DB_CMD_SET_OUTPUT, args), ABSENT);
		}
	}
}

/* Each has one bit that tells of it. */
static void a_bit_of_the_status_shows_the_rest(void **state)
{
	static const struct {
		enum db_command command;
		uint32_t bit;
		bool set;
	} cases[] = {
		{ DB_CMD_ENABLE, VSMD_ST_PWR, true },
		{ DB_CMD_HOME_STOP, VSMD_ST_ZERO, false },
		{ DB_CMD_CLEAR_FAULT, VSMD_ST_ENC_ERR, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct vsmd_axis axis = moving((struct vsmd_goal)REST, 0.0f, 0.0f, 0.0f);
		const struct db_args none = { 0 };

		axis.last.status = cases[i].bit;
		assert_int_equal(judge(&axis, cases[i].command, none),
		                 cases[i].set ? SHOWN : ABSENT);
		axis.last.status = ~cases[i].bit;
		assert_int_equal(judge(&axis, cases[i].command, none),
		                 cases[i].set ? ABSENT : SHOWN);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_way_proves_only_another_direction),
		cmocka_unit_test(the_way_gives_the_sign_of_a_drive_that_tells_none),
		cmocka_unit_test(the_same_speed_again_is_there_at_once),
		cmocka_unit_test(a_speed_has_changed_when_rounding_does_not_explain_it),
		cmocka_unit_test(a_speed_on_the_older_way_is_open),
		cmocka_unit_test(a_speed_of_0_is_a_stand),
		cmocka_unit_test(a_preset_speed_is_judged_where_it_is_known),
		cmocka_unit_test(a_new_target_is_headed_for),
		cmocka_unit_test(a_set_position_is_farther_than_any_way),
		cmocka_unit_test(a_set_position_of_a_standing_drive_is_its_place),
		cmocka_unit_test(an_input_proves_a_level_only_by_following),
		cmocka_unit_test(a_bit_of_the_status_shows_the_rest),
	};

	return cmocka_run_group_tests_name("driver/vsmd_effect", tests, NULL, NULL);
}
