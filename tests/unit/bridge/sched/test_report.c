/* SPDX-License-Identifier: Apache-2.0 */
/* What is reported about drives for the log, once each, and what is published. */
#include "sched/sched_private.h"
#include "vsmd_world.h"

static void assert_logged(struct world *world, enum db_event event, unsigned address)
{
	assert_int_equal(world->told_count, 1);
	assert_string_equal(db_event_name(world->told[0].event), db_event_name(event));
	assert_int_equal(world->told[0].address, address);
	world->told_count = 0;
}

static void a_drive_that_does_not_confirm_its_on_exit_is_logged(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[1].dead = true;
	world->told_count = 0;
	db_engine_shut_down(world->bus->engine, world->bus->now);
	for (unsigned i = 0; i < 1500; i++)
		fake_pass(world->bus, 1 * MS);
	world->told_count = 0;
	db_engine_report_unconfirmed(world->bus->engine);
	assert_logged(world, DB_EVENT_DRIVE_UNCONFIRMED, 2);
}

static void what_is_found_is_logged_once(void **state)
{
	struct world *world = *state;

	world->sim[1].status.status = VSMD_ST_PWR; /* somebody else has set it going */
	world->sim[1].status.velocity = 1200;
	world->sim[1].status.position = 77;
	start_bus(world);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(world->told_count, DRIVES);
	for (size_t i = 0; i < DRIVES; i++) {
		assert_int_equal(world->told[i].event, DB_EVENT_DRIVE_ONLINE);
		if (world->told[i].address != 2)
			continue;
		assert_true(world->told[i].feedback.status & DB_STATUS_MOVING);
		assert_true(world->told[i].feedback.status & DB_STATUS_ENABLED);
		assert_int_equal(world->told[i].feedback.position, 77);
		assert_int_equal(world->told[i].feedback.state, DB_AXIS_CONTINUOUS_MOTION);
	}
}

static void drives_that_go_offline_and_return_are_logged(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->told_count = 0;
	world->sim[0].dead = true;
	pass_seconds(world, 20);
	assert_logged(world, DB_EVENT_DRIVE_LOST, 1);
	world->sim[0].dead = false;
	pass_seconds(world, 3);
	assert_logged(world, DB_EVENT_DRIVE_ONLINE, 1);
}

static void a_clock_that_is_set_makes_no_sample_younger(void **state)
{
	struct world *world = *state;
	struct db_feedback before;
	struct db_feedback after;

	world->bus->engine->wall_offset_us = 1000000;
	start_bus(world);
	before = fake_feedback(world->bus, 0);
	assert_int_equal(before.taken_wall_us, before.taken / 1000 + 1000000);
	world->sim[0].dead = true;
	world->bus->engine->wall_offset_us = 5000000;
	pass_seconds(world, 3);
	after = fake_feedback(world->bus, 0);
	assert_int_equal(after.taken, before.taken);
	assert_int_equal(after.taken_wall_us, before.taken_wall_us);
	world->sim[0].dead = false;
	pass_seconds(world, 3);
	after = fake_feedback(world->bus, 0);
	assert_int_equal(after.taken_wall_us, after.taken / 1000 + 5000000);
}

static void a_drive_that_never_answered_is_logged_once(void **state)
{
	struct world *world = *state;

	world->sim[2].dead = true;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(world->told_count, 2);
	world->told_count = 0;
	pass_seconds(world, 60);
	assert_logged(world, DB_EVENT_DRIVE_LOST, 3);
}

/* Of a lost port there is one line, the bus's; what is found behind it afterwards is told. */
static void a_lost_port_is_not_logged_for_each_drive(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->told_count = 0;
	fake_port(world->bus, 5);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->told_count, 0);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->told_count, DRIVES);
}

static void faults_are_logged_when_they_come_and_go(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->told_count = 0;
	world->sim[1].status.status |= VSMD_ST_OVER_CURRENT;
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->told[0].feedback.error, DB_ERROR_OVER_CURRENT);
	assert_logged(world, DB_EVENT_DRIVE_FAULT, 2);
	world->sim[1].status.status &= ~(uint32_t)VSMD_ST_OVER_CURRENT;
	fake_pass(world->bus, 1000 * MS);
	assert_logged(world, DB_EVENT_DRIVE_FAULT_GONE, 2);
}

static void a_drive_that_lost_power_is_logged(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->told_count = 0;
	world->sim[0].status.status = VSMD_ST_STP; /* no power and no handshake any more */
	fake_pass(world->bus, 1000 * MS);
	assert_logged(world, DB_EVENT_DRIVE_RESTARTED, 1);
	/* That a disabled drive loses its origin as well is what was asked for. */
	fake_post(world->bus, 1, DB_CMD_DISABLE);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(world->told_count, 0);
}

/* A drive alone on its line whose answers arrive after this time (0: never); the number of times that it is logged as lost. */
static unsigned count_lost(db_time answer_time)
{
	struct fake_bus *bus = fake_bus_new(&fake_family, 1);
	unsigned lost;

	bus->config.drive_latency_ms = 10;
	bus->answer_time = answer_time;
	bus->dead[1] = answer_time == 0;
	fake_bus_open(bus, 1, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 20 * DB_NS_PER_S);
	lost = bus->told[DB_EVENT_DRIVE_LOST];
	fake_bus_free(bus);
	return lost;
}

static void a_drive_that_is_only_late_is_not_logged_as_lost(void **state)
{
	(void)state;
	assert_int_equal(count_lost(5 * MS), 0);
	assert_int_equal(count_lost(15 * MS), 0);
	assert_int_equal(count_lost(0), 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST_OF_LINE(a_drive_that_does_not_confirm_its_on_exit_is_logged),
		TEST_OF_LINE(what_is_found_is_logged_once),
		TEST_OF_LINE(drives_that_go_offline_and_return_are_logged),
		TEST_OF_LINE(a_clock_that_is_set_makes_no_sample_younger),
		TEST_OF_LINE(a_drive_that_never_answered_is_logged_once),
		TEST_OF_LINE(a_lost_port_is_not_logged_for_each_drive),
		TEST_OF_LINE(faults_are_logged_when_they_come_and_go),
		TEST_OF_LINE(a_drive_that_lost_power_is_logged),
		cmocka_unit_test(a_drive_that_is_only_late_is_not_logged_as_lost),
	};

	return cmocka_run_group_tests_name("report", tests, NULL, NULL);
}
