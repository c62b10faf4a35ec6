/* SPDX-License-Identifier: Apache-2.0 */
/* Parameter writes that a drive has acknowledged and that nothing proves until it reports their values. */
#include "commander_world.h"

#include "fakes/nameplate.h"

#define PARAMS 12

#define PARAM(called)                                                  \
	{                                                              \
		.name = called, .type = DB_U16, .unit = "", .max = 999 \
	}

static const struct db_param params[PARAMS] = {
	PARAM("p0"), PARAM("p1"), PARAM("p2"), PARAM("p3"), PARAM("p4"),  PARAM("p5"),
	PARAM("p6"), PARAM("p7"), PARAM("p8"), PARAM("p9"), PARAM("p10"), PARAM("p11"),
};

static bool is_same(size_t param, union db_value held, union db_value written)
{
	(void)param;
	return held.u == written.u;
}

static struct db_driver reporting; /* its drives report their parameters from time to time */

struct world {
	struct fake fake;
	struct db_nameplate_copy room;
	struct db_nameplate plate;
};

static void open_world(struct world *world)
{
	struct db_commander_config config;

	init_with(&world->fake, false, 0, false);
	reporting = driver;
	reporting.params = params;
	reporting.param_count = PARAMS;
	reporting.holds = is_same;
	config = config_of(&world->fake);
	config.driver = &reporting;
	remake(&world->fake, &config);
	world->plate = fake_nameplate(&world->room, UINT64_MAX);
}

#define WORLD()             \
	struct world world; \
	(void)state;        \
	open_world(&world)

/* Writes `count` parameters from `first` on, each with `value`. The request's number. */
static unsigned write_some(struct world *world, unsigned first, unsigned count, unsigned value)
{
	struct fake *fake = &world->fake;
	struct db_setting settings[PARAMS];

	for (unsigned i = 0; i < count; i++)
		settings[i] = (struct db_setting){ (uint16_t)(first + i), { .u = value } };
	assert_true(set(fake->commander, NULL, settings, count,
	                (struct db_write_token){ 1, ++fake->next_token }, fake->now)
	                    .later);
	return fake->submitted - 1;
}

static void acknowledge(struct world *world, unsigned request)
{
	finish(&world->fake, request, DB_RESULT_UNPROVEN);
}

/* The drive reports what it holds. */
static void report(struct world *world, unsigned first, unsigned count, unsigned value)
{
	for (unsigned i = first; i < first + count; i++) {
		world->plate.values[i].u = value;
		world->plate.told[i] = db_told_at(world->fake.now);
	}
	db_axis_publish_nameplate(world->fake.axis, &world->plate);
}

static void pass(struct world *world, unsigned ms)
{
	let_pass(&world->fake, ms * MS);
}

static enum db_result result(const struct world *world)
{
	return (enum db_result)look(&world->fake).results.write_result;
}

static void a_reported_value_is_the_proof(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 3, 1, 7));
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	/* It is looked at twice a second. */
	for (unsigned i = 0; i < 4; i++) {
		assert_true(db_commander_next_deadline(world.fake.commander) ==
		            world.fake.now + 500 * MS);
		pass(&world, 500);
	}
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	report(&world, 3, 1, 7);
	pass(&world, 400);
	report(&world, 4, 1, 1);
	pass(&world, 200);
	assert_int_equal(result(&world), DB_RESULT_OK);
	assert_int_equal(entry_of(&world.fake, 0).result, DB_RESULT_OK);
	assert_in_range(entry_of(&world.fake, 0).duration_us, 2000000, 2600000);
	assert_true(db_commander_next_deadline(world.fake.commander) == DB_TIME_NEVER);
	/* It is settled: what comes later is another matter. */
	report(&world, 3, 1, 9);
	pass(&world, 2000);
	assert_int_equal(result(&world), DB_RESULT_OK);
	assert_int_equal(world.fake.refused, 0);
	drop(&world.fake);
}

static void another_value_is_a_refusal_that_is_said(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 3, 2, 7));
	pass(&world, 100);
	report(&world, 3, 1, 7);
	report(&world, 4, 1, 6);
	pass(&world, 1000);
	assert_int_equal(result(&world), DB_RESULT_REFUSED);
	assert_int_equal(entry_of(&world.fake, 0).result, DB_RESULT_REFUSED);
	assert_int_equal(world.fake.refused, 1);
	assert_string_equal(world.fake.refused_write.param, "p4");
	assert_true(world.fake.refused_write.holds_other);
	assert_true(world.fake.refused_write.held > 5.5 && world.fake.refused_write.held < 6.5);
	pass(&world, 2000);
	assert_int_equal(world.fake.refused, 1);
	drop(&world.fake);
}

static void all_values_of_a_write_are_awaited(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 0, 3, 7));
	pass(&world, 100);
	report(&world, 0, 2, 7);
	pass(&world, 2000);
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	report(&world, 2, 1, 7);
	pass(&world, 1000);
	assert_int_equal(result(&world), DB_RESULT_OK);
	drop(&world.fake);
}

/* What it reported before, or between the write and its acknowledgement, may be the value of before. */
static void only_what_is_reported_later_counts(void **state)
{
	unsigned request;

	WORLD();
	report(&world, 3, 1, 6);
	request = write_some(&world, 3, 1, 7);
	pass(&world, 30);
	report(&world, 3, 1, 6);
	acknowledge(&world, request);
	pass(&world, 2000);
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	/* Nor what cannot be read any more. */
	world.plate.valid[0] &= ~(UINT64_C(1) << 3);
	report(&world, 3, 1, 6);
	pass(&world, 2000);
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	drop(&world.fake);
}

/* Nobody can say of the older one whether it arrived. */
static void a_later_write_to_the_same_parameter_leaves_the_older_one_open(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 3, 2, 7));
	pass(&world, 100);
	acknowledge(&world, write_some(&world, 4, 1, 8));
	pass(&world, 100);
	report(&world, 3, 1, 7);
	report(&world, 4, 1, 8);
	pass(&world, 1000);
	assert_int_equal(result(&world), DB_RESULT_OK);
	assert_int_equal(entry_of(&world.fake, 0).result, DB_RESULT_OK);
	assert_int_equal(entry_of(&world.fake, 1).result, DB_RESULT_UNPROVEN);
	assert_int_equal(world.fake.refused, 0);
	drop(&world.fake);
}

/* Whichever of its parameters it is. */
static void any_common_parameter_leaves_the_older_one_open(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 5, 1, 7));
	acknowledge(&world, write_some(&world, 4, 2, 8));
	pass(&world, 100);
	report(&world, 4, 2, 8);
	pass(&world, 1000);
	assert_int_equal(entry_of(&world.fake, 0).result, DB_RESULT_OK);
	assert_int_equal(entry_of(&world.fake, 1).result, DB_RESULT_UNPROVEN);
	assert_int_equal(world.fake.refused, 0);
	drop(&world.fake);
}

static void writes_to_different_parameters_are_settled_each(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 3, 1, 7));
	acknowledge(&world, write_some(&world, 5, 1, 8));
	pass(&world, 100);
	report(&world, 3, 1, 6);
	pass(&world, 1000);
	assert_int_equal(entry_of(&world.fake, 1).result, DB_RESULT_REFUSED);
	assert_int_equal(entry_of(&world.fake, 0).result, DB_RESULT_UNPROVEN);
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	report(&world, 5, 1, 8);
	pass(&world, 1000);
	assert_int_equal(entry_of(&world.fake, 0).result, DB_RESULT_OK);
	drop(&world.fake);
}

/* The oldest stay open. */
static void so_many_are_remembered(void **state)
{
	WORLD();
	for (unsigned i = 0; i < DB_SETTLE_MAX + 1; i++) {
		acknowledge(&world, write_some(&world, i, 1, 7));
		pass(&world, 20);
	}
	report(&world, 0, PARAMS, 7);
	pass(&world, 1000);
	for (unsigned i = 0; i < DB_SETTLE_MAX; i++)
		assert_int_equal(entry_of(&world.fake, i).result, DB_RESULT_OK);
	assert_int_equal(entry_of(&world.fake, DB_SETTLE_MAX).result, DB_RESULT_UNPROVEN);
	drop(&world.fake);
}

static void a_write_of_more_is_not_settled_in_part(void **state)
{
	WORLD();
	acknowledge(&world, write_some(&world, 0, DB_SETTLE_MAX, 7));
	pass(&world, 20);
	report(&world, 0, PARAMS, 7);
	pass(&world, 1000);
	assert_int_equal(result(&world), DB_RESULT_OK);
	acknowledge(&world, write_some(&world, 0, DB_SETTLE_MAX + 1, 8));
	pass(&world, 20);
	report(&world, 0, PARAMS, 9);
	pass(&world, 1000);
	assert_int_equal(result(&world), DB_RESULT_UNPROVEN);
	assert_int_equal(world.fake.refused, 0);
	drop(&world.fake);
}

/* The drive has answered for itself. */
static void a_write_that_ended_otherwise_is_settled(void **state)
{
	WORLD();
	finish(&world.fake, write_some(&world, 3, 1, 7), DB_RESULT_OK);
	pass(&world, 100);
	report(&world, 3, 1, 6);
	pass(&world, 1000);
	assert_int_equal(result(&world), DB_RESULT_OK);
	assert_int_equal(world.fake.refused, 0);
	drop(&world.fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_reported_value_is_the_proof),
		cmocka_unit_test(another_value_is_a_refusal_that_is_said),
		cmocka_unit_test(all_values_of_a_write_are_awaited),
		cmocka_unit_test(only_what_is_reported_later_counts),
		cmocka_unit_test(a_later_write_to_the_same_parameter_leaves_the_older_one_open),
		cmocka_unit_test(any_common_parameter_leaves_the_older_one_open),
		cmocka_unit_test(writes_to_different_parameters_are_settled_each),
		cmocka_unit_test(so_many_are_remembered),
		cmocka_unit_test(a_write_of_more_is_not_settled_in_part),
		cmocka_unit_test(a_write_that_ended_otherwise_is_settled),
	};

	return cmocka_run_group_tests_name("axis/settle", tests, NULL, NULL);
}
