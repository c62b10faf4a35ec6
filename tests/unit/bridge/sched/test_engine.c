/* SPDX-License-Identifier: Apache-2.0 */
/* The schedule: what is on the wire, in which order, and what the bus waits for. */
#include "vsmd_world.h"

static void drives_come_online_and_report_their_parameters(void **state)
{
	struct world *world = *state;
	struct db_nameplate_copy copy;
	const struct db_nameplate *plate = &copy.plate;

	assert_int_equal(status_of(world, 0), 0);
	start_bus(world);
	for (size_t i = 0; i < DRIVES; i++) {
		assert_true(status_of(world, i) & DB_STATUS_ONLINE);
		assert_true(status_of(world, i) & DB_STATUS_PARAMS_VALID);
	}
	db_axis_read_nameplate(world->bus->list[2].axis, &copy);
	assert_string_equal(plate->identity, "VSMD113_025T-1.0.008.170428");
	assert_true(plate->values[VSMD_SPD].f == 6400.0f);
	assert_true(plate->values[VSMD_ACC].f == 24000.0f);
	assert_true(db_params_have(plate->valid, VSMD_BDR));
	assert_false(db_params_have(plate->valid, VSMD_MCS));
}

static void every_drive_is_polled_once_a_cycle(void **state)
{
	struct world *world = *state;
	struct db_bus_stats stats;

	start_bus(world);
	fake_pass(world->bus, 200 * MS);
	assert_in_range(count_sent(world, "1 sts\n"), 9, 11);
	assert_in_range(count_sent(world, "2 sts\n"), 9, 11);
	assert_in_range(count_sent(world, "3 sts\n"), 9, 11);
	assert_int_equal(count_sent(world, "dev"), 0);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.overruns, 0);
	assert_int_equal(stats.online, 3);
	assert_in_range(stats.cycle_us, 6000, 6500);
	assert_in_range(stats.cycle_max_us, stats.cycle_us, 30000);
}

/* Each question is answered twice, from different places: neither can be believed. */
static void two_drives_at_one_address_are_told(void **state)
{
	struct world *world = *state;
	unsigned told = 0;

	start_bus(world);
	world->told_count = 0;
	world->sim[1].has_twin = true;
	fake_pass(world->bus, 3000 * MS);
	for (size_t i = 0; i < world->told_count; i++) {
		assert_int_equal(world->told[i].address, 2);
		told += world->told[i].event == DB_EVENT_DRIVE_DOUBLED;
	}
	assert_int_equal(told, 1);
	/* What it says itself is what is shown, and the others go on. */
	assert_int_equal(fake_feedback(world->bus, 1).position, world->sim[1].status.position);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
	assert_true(fake_stats(world->bus).stray_frames > 0);
}

static void a_cycle_that_does_not_fit_overruns_and_stays_fair(void **state)
{
	struct world *world = *state;
	struct db_bus_stats stats;

	db_engine_free(world->bus->engine);
	db_queue_free(world->bus->queue);
	world->bus->config.cycle_ms = 4;
	world->bus->config.polls_evenly = true;
	fake_bus_open(world->bus, DRIVES, &ops);
	start_bus(world);
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_PARAMS_VALID);
	fake_pass(world->bus, 120 * MS);
	assert_in_range(count_sent(world, "1 sts\n"), 19, 21);
	assert_in_range(count_sent(world, "2 sts\n"), 19, 21);
	assert_in_range(count_sent(world, "3 sts\n"), 19, 21);
	stats = fake_stats(world->bus);
	assert_true(stats.overruns > 20);
}

static void a_dead_drive_costs_little(void **state)
{
	struct world *world = *state;

	world->sim[1].dead = true;
	start_bus(world);
	fake_pass(world->bus, 5000 * MS); /* the backoff has grown */
	world->log[0] = '\0';
	assert_false(status_of(world, 1) & DB_STATUS_ONLINE);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
	fake_pass(world->bus, 2000 * MS);
	assert_in_range(count_sent(world, "1 sts\n"), 99, 101);
	assert_in_range(count_sent(world, "2 dev\n"), 1, 3);
	world->sim[1].dead = false;
	fake_pass(world->bus, 2500 * MS);
	assert_true(status_of(world, 1) & DB_STATUS_ONLINE);
	assert_true(status_of(world, 1) & DB_STATUS_PARAMS_VALID);
}

static void a_stop_overtakes_and_cancels(void **state)
{
	struct world *world = *state;
	struct db_request completion;
	unsigned cancelled = 0;

	enable_first(world);
	for (int i = 0; i < 4; i++)
		post_motion(world, 0, DB_CMD_MOVE_ABSOLUTE, 1000 + i);
	fake_post(world->bus, 1, DB_CMD_ENABLE);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 30 * MS);
	assert_true(strncmp(world->log, "1 stp\n", 6) == 0 ||
	            strncmp(strchr(world->log, '\n') + 1, "1 stp\n", 6) == 0);
	assert_int_equal(count_sent(world, "1 pos"), 0);
	while (fake_collect(world->bus->queue, &completion)) {
		if (completion.result == DB_RESULT_CANCELLED)
			cancelled++;
		else
			assert_int_equal(completion.result, DB_RESULT_OK);
	}
	assert_int_equal(cancelled, 4);
	assert_int_equal(world->sim[1].executed[VSMD_ENA], 1);
}

/* Runs until the bus is idle, with an empty log. Returns when the engine wants to be run again. */
static db_time wait_idle(struct world *world)
{
	size_t come;
	db_time next;

	do {
		fake_pass(world->bus, MS);
		next = db_engine_run(world->bus->engine, world->bus->now);
	} while (next < world->bus->now + 2 * MS ||
	         db_engine_awaited(world->bus->engine, &come) > 0);
	world->log[0] = '\0';
	return next;
}

/* Other things may wake the thread. What comes in between is seen to at once all the same. */
static void a_turn_without_news_is_over_at_once(void **state)
{
	struct world *world = *state;
	struct db_engine *engine = world->bus->engine;
	db_time now;
	db_time next;
	db_time soon;

	start_bus(world);
	next = wait_idle(world);
	now = world->bus->now;
	assert_int_equal(db_engine_run(engine, now + MS), next);
	assert_string_equal(world->log, "");
	fake_post(world->bus, 0, DB_CMD_STOP);
	world->bus->now = now + MS;
	/* It is sent, or as soon as the others hear whom it is for. */
	soon = db_engine_run(engine, now + MS);
	assert_true(soon < next || world->log[0] != '\0');
	fake_pass(world->bus, soon - world->bus->now + 1);
	assert_string_equal(world->log, "1 stp\n");
}

static void a_port_that_takes_bytes_again_is_news(void **state)
{
	struct world *world = *state;
	struct db_engine *engine = world->bus->engine;
	db_time next;
	db_time soon;

	start_bus(world);
	next = wait_idle(world);
	db_engine_hold(engine, true, world->bus->now);
	fake_post(world->bus, 0, DB_CMD_STOP);
	(void)db_engine_run(engine, world->bus->now);
	assert_string_equal(world->log, "");
	db_engine_hold(engine, false, world->bus->now);
	soon = db_engine_run(engine, world->bus->now);
	assert_true(soon < next || world->log[0] != '\0');
}

static void the_end_is_news(void **state)
{
	struct world *world = *state;
	struct db_engine *engine = world->bus->engine;
	db_time next;
	db_time soon;

	enable_first(world);
	next = wait_idle(world);
	db_engine_shut_down(engine, world->bus->now);
	soon = db_engine_run(engine, world->bus->now);
	assert_true(soon < next || world->log[0] != '\0');
}

static void a_stop_is_repeated_until_confirmed(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].dead = true;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 2000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	assert_true(count_sent(world, "1 stp\n") > 5);
	/* And the others are not starved by it. */
	assert_in_range(count_sent(world, "2 sts\n"), 80, 101);
	world->sim[0].dead = false;
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_true(world->sim[0].executed[VSMD_STP] >= 1);
}

static void a_lost_port_ends_everything_and_comes_back(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->bus->answer_count = 0;
	fake_port(world->bus, 5);
	world->bus->answer_count = 0;
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_BUS_DOWN);
	assert_false(status_of(world, 0) & DB_STATUS_BUS_UP);
	assert_false(status_of(world, 0) & DB_STATUS_ONLINE);
	start_bus(world);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
}

/* Who reads the registers sees it with the next read, of every drive. */
static void a_port_that_is_lost_shows_at_once(void **state)
{
	struct world *world = *state;

	start_bus(world);
	fake_port(world->bus, 5);
	for (size_t i = 0; i < DRIVES; i++)
		assert_int_equal(status_of(world, i) & (DB_STATUS_BUS_UP | DB_STATUS_ONLINE), 0);
	assert_int_equal(fake_stats(world->bus).last_error, 5);
	assert_int_equal(fake_stats(world->bus).opens, 1);
	/* And when it is back. */
	fake_port(world->bus, 0);
	for (size_t i = 0; i < DRIVES; i++)
		assert_int_equal(status_of(world, i) & (DB_STATUS_BUS_UP | DB_STATUS_ONLINE),
		                 DB_STATUS_BUS_UP);
}

/* Whatever was on the wire when it was lost. */
static void a_port_that_is_back_begins_anew(void **state)
{
	struct world *world = *state;

	start_bus(world);
	for (unsigned i = 0; i < 40; i++) {
		struct db_bus_stats before = fake_stats(world->bus);

		fake_pass(world->bus, i * 530 * MS / 1000);
		fake_port(world->bus, 5);
		world->bus->answer_count = 0;
		fake_pass(world->bus, 250 * MS);
		fake_port(world->bus, 0);
		assert_int_equal(fake_stats(world->bus).opens, before.opens + 1);
		fake_pass(world->bus, 40 * MS);
		world->log[0] = '\0';
		world->told_count = 0;
		for (size_t k = 0; k < DRIVES; k++)
			assert_true(status_of(world, k) & DB_STATUS_ONLINE);
		/* No cycle was missed that could have been kept. */
		assert_int_equal(fake_stats(world->bus).overruns, before.overruns);
		assert_int_equal(fake_stats(world->bus).timeouts, before.timeouts);
		assert_in_range(fake_stats(world->bus).jitter_max_us, 0, 10000);
	}
}

/* Whatever was the time of its next probe: the port may have been what was missing. */
static void one_that_was_gone_for_long_is_looked_for_when_the_port_is_back(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->sim[0].dead = true;
	pass_seconds(world, 10);
	assert_false(status_of(world, 0) & DB_STATUS_ONLINE);
	while (count_sent(world, "1 dev\n") == 0)
		fake_pass(world->bus, MS);
	fake_pass(world->bus, 50 * MS);
	fake_port(world->bus, 5);
	fake_pass(world->bus, 10 * MS);
	world->sim[0].dead = false;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 40 * MS);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
	/* Also if it needs a moment longer. */
	world->sim[0].dead = true;
	pass_seconds(world, 10);
	fake_port(world->bus, 5);
	fake_pass(world->bus, 10 * MS);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 50 * MS);
	world->sim[0].dead = false;
	fake_pass(world->bus, 150 * MS);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
}

/* Without its port the bus has asked to be run at no time, whatever it asked for before. */
static void a_bus_without_its_port_oversleeps_nothing(void **state)
{
	struct world *world = *state;
	struct db_engine *engine = world->bus->engine;

	start_bus(world);
	(void)wait_idle(world);
	fake_port(world->bus, 5);
	(void)db_engine_run(engine, world->bus->now);
	world->bus->now += 500 * MS;
	(void)db_engine_run(engine, world->bus->now);
	assert_int_equal(fake_stats(world->bus).overslept_us, 0);
}

static void a_drive_that_lost_power_is_read_again(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].status = (struct vsmd_status){ .status = VSMD_ST_STP };
	fake_pass(world->bus, 300 * MS);
	assert_true(count_sent(world, "1 cfg\n") >= 1);
	assert_true(status_of(world, 0) & DB_STATUS_ORIGIN_LOST);
}

/* The text of all parameters takes as long on the wire as many commands: a stop would wait behind it. */
static void no_drive_is_asked_for_its_parameters_while_another_moves(void **state)
{
	struct world *world = *state;

	world->bus->config.baud = 9600;
	world->sim[2].dead = true;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 2000 * MS);
	world->sim[0].status.status &= ~(uint32_t)VSMD_ST_STP;
	fake_pass(world->bus, 200 * MS);
	assert_true(status_of(world, 0) & DB_STATUS_MOVING);
	world->sim[2].dead = false;
	world->log[0] = '\0';
	fake_pass(world->bus, 4000 * MS);
	assert_true(status_of(world, 2) & DB_STATUS_ONLINE);
	assert_int_equal(count_sent(world, " cfg\n"), 0);
	/* All stand. */
	world->sim[0].status.status |= VSMD_ST_STP;
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(count_sent(world, "3 cfg\n"), 1);
	assert_true(status_of(world, 2) & DB_STATUS_PARAMS_VALID);
}

/* Also of drives of which nothing is known yet: no stop waits for that. */
static void unknown_parameters_stay_unknown_while_a_drive_moves(void **state)
{
	struct world *world = *state;

	world->bus->config.baud = 9600;
	world->sim[0].status.status &= ~(uint32_t)VSMD_ST_STP;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
	for (unsigned seconds = 0; seconds < 35; seconds++) {
		world->log[0] = '\0';
		fake_pass(world->bus, 1000 * MS);
		assert_int_equal(count_sent(world, " cfg\n"), 0);
	}
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_ONLINE);
	/* Who asks for it is refused at once. */
	world->log[0] = '\0';
	fake_post(world->bus, 1, DB_CMD_READ_PARAMETERS);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_LINE_MOVES);
	assert_int_equal(count_sent(world, "2 cfg\n"), 0);
	world->sim[0].status.status |= VSMD_ST_STP;
	fake_pass(world->bus, 1000 * MS);
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_PARAMS_VALID);
}

static void the_end_stops_every_drive(void **state)
{
	struct world *world = *state;

	enable_first(world);
	db_engine_shut_down(world->bus->engine, world->bus->now);
	fake_pass(world->bus, 50 * MS);
	assert_true(db_engine_is_quiet(world->bus->engine, false));
	/* All at once by broadcast, then each one for its confirmation. */
	assert_memory_equal(world->log, "0 stp\n1 stp\n", 12);
	assert_int_equal(count_sent(world, " stp\n"), 4);
}

/* To all at once only what none was told yet. */
static void a_stop_that_one_was_told_is_not_said_to_all(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->sim[0].dead = true;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 5 * MS);
	assert_int_equal(count_sent(world, "1 stp\n"), 1);
	fake_post(world->bus, 1, DB_CMD_STOP);
	fake_post(world->bus, 2, DB_CMD_STOP);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(count_sent(world, "0 stp\n"), 0);
	assert_int_equal(count_sent(world, "2 stp\n"), 1);
	assert_int_equal(count_sent(world, "3 stp\n"), 1);
}

static void a_stop_at_the_end_that_is_refused_is_repeated(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].status.status = VSMD_ST_HS | VSMD_ST_PWR; /* runs */
	fake_pass(world->bus, 50 * MS);
	/* Otherwise a broadcast would have stopped it already. */
	world->bus->drives[1].on_exit = DB_ON_LOSS_NONE;
	fail_next(world, 0, VSMD_STP, FAULT_REFUSE);
	db_engine_shut_down(world->bus->engine, world->bus->now);
	for (unsigned i = 0; i < 200 && !db_engine_is_quiet(world->bus->engine, false); i++)
		fake_pass(world->bus, 1 * MS);
	assert_true(db_engine_is_quiet(world->bus->engine, false));
	assert_int_equal(count_sent(world, "1 stp\n"), 2);
	assert_true(world->sim[0].status.status & VSMD_ST_STP);
}

static void a_drive_that_is_offline_at_the_end_is_stopped_when_it_answers(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->sim[1].status.status = VSMD_ST_HS | VSMD_ST_PWR; /* runs */
	world->sim[1].dead = true;
	fake_pass(world->bus, 200 * MS);
	assert_false(status_of(world, 1) & DB_STATUS_ONLINE);
	/* The line is whole again, and nobody has noticed. */
	world->sim[1].dead = false;
	db_engine_shut_down(world->bus->engine, world->bus->now);
	for (unsigned i = 0; i < 1500 && !db_engine_is_quiet(world->bus->engine, false); i++)
		fake_pass(world->bus, 1 * MS);
	assert_true(world->sim[1].status.status & VSMD_ST_STP);
}

static void silent_drives_do_not_keep_a_stop_from_one_that_answers(void **state)
{
	struct world *world = *state;

	world->sim[0].dead = world->sim[1].dead = true;
	start_bus(world);
	fake_pass(world->bus, 1000 * MS);
	for (unsigned i = 0; i < 4; i++) {
		fake_post(world->bus, 0, DB_CMD_STOP);
		fake_post(world->bus, 1, DB_CMD_QUICK_STOP);
	}
	fake_pass(world->bus, 1000 * MS);
	world->log[0] = '\0';
	world->sim[2].status.status = VSMD_ST_HS | VSMD_ST_PWR; /* runs */
	fake_post(world->bus, 2, DB_CMD_STOP);
	/* At most the one transaction that is on the wire. */
	fake_pass(world->bus, 25 * MS);
	assert_true(world->sim[2].status.status & VSMD_ST_STP);
	/* Both silent ones share one part of the bus. */
	world->log[0] = '\0';
	fake_pass(world->bus, 1000 * MS);
	assert_true(count_sent(world, "3 sts\n") > 40);
	assert_true(count_sent(world, "1 stp") > 3 && count_sent(world, "2 stp") > 3);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST_OF_LINE(drives_come_online_and_report_their_parameters),
		TEST_OF_LINE(every_drive_is_polled_once_a_cycle),
		TEST_OF_LINE(two_drives_at_one_address_are_told),
		TEST_OF_LINE(a_cycle_that_does_not_fit_overruns_and_stays_fair),
		TEST_OF_LINE(a_dead_drive_costs_little),
		TEST_OF_LINE(a_stop_overtakes_and_cancels),
		TEST_OF_LINE(a_turn_without_news_is_over_at_once),
		TEST_OF_LINE(a_port_that_takes_bytes_again_is_news),
		TEST_OF_LINE(the_end_is_news),
		TEST_OF_LINE(a_stop_is_repeated_until_confirmed),
		TEST_OF_LINE(a_lost_port_ends_everything_and_comes_back),
		TEST_OF_LINE(a_port_that_is_lost_shows_at_once),
		TEST_OF_LINE(a_port_that_is_back_begins_anew),
		TEST_OF_LINE(one_that_was_gone_for_long_is_looked_for_when_the_port_is_back),
		TEST_OF_LINE(a_bus_without_its_port_oversleeps_nothing),
		TEST_OF_LINE(a_drive_that_lost_power_is_read_again),
		TEST_OF_LINE(no_drive_is_asked_for_its_parameters_while_another_moves),
		TEST_OF_LINE(unknown_parameters_stay_unknown_while_a_drive_moves),
		TEST_OF_LINE(the_end_stops_every_drive),
		TEST_OF_LINE(a_stop_that_one_was_told_is_not_said_to_all),
		TEST_OF_LINE(a_stop_at_the_end_that_is_refused_is_repeated),
		TEST_OF_LINE(a_drive_that_is_offline_at_the_end_is_stopped_when_it_answers),
		TEST_OF_LINE(silent_drives_do_not_keep_a_stop_from_one_that_answers),
	};

	return cmocka_run_group_tests_name("engine", tests, NULL, NULL);
}
