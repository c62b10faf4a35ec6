/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/motion.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static struct sim_motion standing(double acc, double dec)
{
	struct sim_motion motion;

	sim_motion_init(&motion, 0);
	motion.acc = acc;
	motion.dec = dec;
	return motion;
}

/* Runs in 1 ms steps until it stands; returns the seconds used. */
static double run_out(struct sim_motion *motion)
{
	db_time start = motion->time;

	while (sim_motion_moving(motion) && motion->time - start < 100000 * MS)
		sim_motion_advance(motion, motion->time + MS);
	return (double)(motion->time - start) / 1e9;
}

static void assert_near(double actual, double expected, double tolerance)
{
	if (fabs(actual - expected) > tolerance)
		fail_msg("%.9f is not %.9f within %g", actual, expected, tolerance);
}

static void trapezoid_takes_the_time_of_the_formula(void **state)
{
	double acc = 20000.0, dec = 40000.0, speed = 8000.0, distance = 30000.0;
	double ramps = speed * speed / 2.0 / acc + speed * speed / 2.0 / dec;
	double seconds = speed / acc + speed / dec + (distance - ramps) / speed;
	struct sim_motion motion = standing(acc, dec);

	(void)state;
	sim_motion_move(&motion, distance, speed);
	assert_near(run_out(&motion), seconds, 0.00101);
	assert_near(motion.position, distance, 0.0);

	/* In one leap it ends at the same place, and halfway it is where the formula says. */
	motion = standing(acc, dec);
	sim_motion_move(&motion, distance, speed);
	sim_motion_advance(&motion, 200 * MS);
	assert_near(motion.position, 0.5 * acc * 0.2 * 0.2, 1e-6);
	assert_near(motion.velocity, acc * 0.2, 1e-6);
	sim_motion_advance(&motion, (db_time)((seconds - 0.1) * 1e9));
	assert_near(motion.velocity, dec * 0.1, 0.01);
	assert_near(motion.position, distance - 0.5 * dec * 0.1 * 0.1, 0.01);
	sim_motion_advance(&motion, (db_time)(seconds * 1e9) + 1000);
	assert_false(sim_motion_moving(&motion));
}

static void short_move_is_a_triangle(void **state)
{
	double acc = 10000.0, dec = 20000.0, distance = -600.0;
	double peak = sqrt(2.0 * acc * dec * -distance / (acc + dec));
	struct sim_motion motion = standing(acc, dec);

	(void)state;
	sim_motion_move(&motion, distance, 50000.0);
	sim_motion_advance(&motion, (db_time)(peak / acc * 1e9));
	assert_near(motion.velocity, -peak, 0.01);
	assert_near(run_out(&motion), peak / dec, 0.00101);
	assert_near(motion.position, distance, 0.0);
}

static void without_ramps_speed_jumps(void **state)
{
	struct sim_motion motion = standing(0.0, 0.0);

	(void)state;
	sim_motion_move(&motion, 1000.0, 500.0);
	sim_motion_advance(&motion, MS);
	assert_near(motion.velocity, 500.0, 0.0);
	assert_near(run_out(&motion), 1.999, 0.00101);
	assert_near(motion.position, 1000.0, 0.0);
	sim_motion_run(&motion, -500.0);
	sim_motion_advance(&motion, motion.time + 10 * MS);
	sim_motion_stop(&motion);
	assert_false(sim_motion_moving(&motion));
	assert_near(motion.position, 995.0, 1.0);
}

static void mixed_ramps_still_arrive(void **state)
{
	struct sim_motion motion = standing(0.0, 10000.0);

	(void)state;
	sim_motion_move(&motion, 3000.0, 4000.0);
	(void)run_out(&motion);
	assert_near(motion.position, 3000.0, 0.0);
	motion.acc = 10000.0;
	motion.dec = 0.0;
	sim_motion_move(&motion, -77.0, 4000.0);
	(void)run_out(&motion);
	assert_near(motion.position, -77.0, 0.0);
}

static void new_target_behind_reverses_after_braking(void **state)
{
	struct sim_motion motion = standing(10000.0, 10000.0);
	double farthest = 0.0;

	(void)state;
	sim_motion_move(&motion, 100000.0, 5000.0);
	sim_motion_advance(&motion, 1000 * MS);
	assert_near(motion.position, 3750.0, 1e-3);
	sim_motion_move(&motion, 0.0, 5000.0);
	while (sim_motion_moving(&motion)) {
		sim_motion_advance(&motion, motion.time + MS);
		farthest = fmax(farthest, motion.position);
	}
	assert_near(farthest, 3750.0 + 5000.0 * 5000.0 / 20000.0, 0.01);
	assert_near(motion.position, 0.0, 0.0);
}

static void target_too_near_overshoots_and_comes_back(void **state)
{
	struct sim_motion motion = standing(10000.0, 10000.0);
	double farthest = 0.0;

	(void)state;
	sim_motion_run(&motion, 5000.0);
	sim_motion_advance(&motion, 1000 * MS);
	sim_motion_move(&motion, 4000.0, 5000.0);
	while (sim_motion_moving(&motion)) {
		sim_motion_advance(&motion, motion.time + MS);
		farthest = fmax(farthest, motion.position);
	}
	assert_near(farthest, 5000.0, 0.01);
	assert_near(motion.position, 4000.0, 0.0);
}

static void stop_brakes_and_halt_does_not(void **state)
{
	struct sim_motion motion = standing(10000.0, 20000.0);

	(void)state;
	sim_motion_run(&motion, 2000.0);
	sim_motion_advance(&motion, 500 * MS);
	sim_motion_stop(&motion);
	assert_near(run_out(&motion), 0.1, 0.00101);
	assert_near(motion.position, 200.0 + 600.0 + 100.0, 0.0);
	sim_motion_run(&motion, 2000.0);
	sim_motion_advance(&motion, motion.time + 500 * MS);
	sim_motion_halt(&motion);
	assert_near(motion.velocity, 0.0, 0.0);
	assert_near(motion.position, 1700.0, 1.0);
}

static void soft_limit_holds_at_once_and_outside_nothing_moves(void **state)
{
	struct sim_motion motion = standing(10000.0, 10000.0);

	(void)state;
	motion.limit_min = -500.0;
	motion.limit_max = 1000.0;
	sim_motion_run(&motion, 4000.0);
	(void)run_out(&motion);
	assert_near(motion.position, 1000.0, 0.0);
	sim_motion_move(&motion, -2000.0, 4000.0); /* at the limit it may go back */
	(void)run_out(&motion);
	assert_near(motion.position, -500.0, 0.0);
	sim_motion_set_position(&motion, -501.0);
	sim_motion_run(&motion, 100.0);
	assert_false(sim_motion_moving(&motion));
}

static void shaking_swings_and_ends_where_it_began(void **state)
{
	struct sim_motion motion = standing(10000.0, 10000.0);

	(void)state;
	sim_motion_shake(&motion, 400.0, 2.0, 3.0);
	sim_motion_advance(&motion, 250 * MS);
	assert_near(motion.position, 400.0, 1e-6);
	sim_motion_advance(&motion, 375 * MS);
	assert_near(motion.position, 200.0, 1e-6);
	assert_near(motion.velocity, -200.0 * 4.0 * acos(-1.0), 1e-6);
	assert_near(run_out(&motion), 1.125, 0.00101);
	assert_near(motion.position, 0.0, 0.0);
}

static void long_distances_end_exactly(void **state)
{
	struct sim_motion motion = standing(24000.0, 13000.0);

	(void)state;
	sim_motion_set_position(&motion, -2147483648.0);
	sim_motion_move(&motion, 2147483647.0, 192000.0);
	sim_motion_advance(&motion, 30000 * DB_NS_PER_S);
	assert_false(sim_motion_moving(&motion));
	assert_near(motion.position, 2147483647.0, 0.0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(trapezoid_takes_the_time_of_the_formula),
		cmocka_unit_test(short_move_is_a_triangle),
		cmocka_unit_test(without_ramps_speed_jumps),
		cmocka_unit_test(mixed_ramps_still_arrive),
		cmocka_unit_test(new_target_behind_reverses_after_braking),
		cmocka_unit_test(target_too_near_overshoots_and_comes_back),
		cmocka_unit_test(stop_brakes_and_halt_does_not),
		cmocka_unit_test(soft_limit_holds_at_once_and_outside_nothing_moves),
		cmocka_unit_test(shaking_swings_and_ends_where_it_began),
		cmocka_unit_test(long_distances_end_exactly),
	};

	return cmocka_run_group_tests_name("sim/motion", tests, NULL, NULL);
}
