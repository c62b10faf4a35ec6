/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a line is kept free for, which exchanges are too long for it, and how busy it is.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static struct fake_bus *open_bus(struct db_driver *driver, enum db_medium medium)
{
	struct fake_bus *bus;

	*driver = fake_family;
	driver->medium = medium;
	bus = fake_bus_new(driver, 3);
	fake_bus_open(bus, 3, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	while (bus->engine->flights > 0)
		fake_pass(bus, MS / 10);
	return bus;
}

/* --- what it is kept for ---------------------------------------------------------------------- */

static void a_line_is_kept_for_the_first_of_several_stops(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	struct db_engine *engine = bus->engine;
	const struct reserved *reserved = &engine->reserved;
	db_time now = bus->now;

	(void)state;
	exchange_reserve(engine, engine->stations[0], LANE_COMMAND, now + 5 * MS, now);
	assert_true(reserved->station == engine->stations[0] && reserved->until == now + 5 * MS);
	/* Something else takes its place, also a stop. */
	exchange_reserve(engine, engine->stations[1], LANE_POLL, now + 9 * MS, now);
	assert_true(reserved->station == engine->stations[1] && reserved->until == now + 9 * MS);
	exchange_reserve(engine, engine->stations[0], LANE_STOP, now + 10 * MS, now + MS);
	assert_true(reserved->lane == LANE_STOP && reserved->since == now + MS);
	/* But nothing takes the place of a stop: nor another stop that is later. */
	exchange_reserve(engine, engine->stations[1], LANE_COMMAND, now + 2 * MS, now + MS);
	assert_true(reserved->lane == LANE_STOP && reserved->until == now + 10 * MS);
	exchange_reserve(engine, engine->stations[2], LANE_STOP, now + 11 * MS, now + MS);
	assert_true(reserved->station == engine->stations[0] && reserved->until == now + 10 * MS);
	/* One that is earlier shares it, since when it is kept. */
	exchange_reserve(engine, engine->stations[2], LANE_STOP, now + 8 * MS, now + 3 * MS);
	assert_true(reserved->station == engine->stations[2] && reserved->until == now + 8 * MS);
	assert_true(reserved->since == now + MS);
	/* Its time is over. */
	exchange_reserve(engine, engine->stations[1], LANE_COMMAND, now + 12 * MS, now + 8 * MS);
	assert_true(reserved->lane == LANE_COMMAND && reserved->since == now + 8 * MS);
	fake_bus_free(bus);
}

/* --- what is too long for it ------------------------------------------------------------------ */

/* The last drive of the line is the one that counts. */
static void nothing_long_begins_while_a_drive_may_move(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	struct db_engine *engine = bus->engine;
	struct station *station = engine->stations[2];
	struct lane *command = &station->lanes[LANE_COMMAND];
	db_time taken = station->snapshot.feedback.taken;
	const struct db_request motion = { .command = DB_CMD_MOVE_ABSOLUTE };
	const struct db_request other = { .command = DB_CMD_ENABLE };

	(void)state;
	assert_false(exchange_must_be_short(engine));
	station->snapshot.feedback.status |= DB_STATUS_MOVING;
	assert_true(exchange_must_be_short(engine));
	/* One that is gone is not kept from its stop by that. */
	station->node->online = false;
	assert_false(exchange_must_be_short(engine));
	station->node->online = true;
	station->snapshot.feedback.status &= ~(uint32_t)DB_STATUS_MOVING;
	/* It was read after the motion was sent, or not. */
	station->motion_sent = taken;
	assert_false(exchange_must_be_short(engine));
	station->motion_sent = taken + 1;
	assert_true(exchange_must_be_short(engine));
	station->motion_sent = 0;
	/* A motion that is under way. */
	command->job = (struct db_job){ .kind = DB_JOB_COMMAND, .request = &motion };
	command->active = true;
	assert_false(exchange_must_be_short(engine));
	command->sent = true;
	assert_true(exchange_must_be_short(engine));
	command->job.request = &other;
	assert_false(exchange_must_be_short(engine));
	command->active = command->sent = false;
	/* A stop that has had no effect yet. */
	station->standing.kind = DB_CMD_STOP;
	assert_true(exchange_must_be_short(engine));
	station->standing.obeys = true;
	assert_false(exchange_must_be_short(engine));
	station->standing.kind = DB_CMD_NONE;
	fake_bus_free(bus);
}

static void on_can_nothing_is_too_long(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_CAN);

	(void)state;
	bus->engine->stations[2]->snapshot.feedback.status |= DB_STATUS_MOVING;
	assert_false(exchange_must_be_short(bus->engine));
	fake_bus_free(bus);
}

/* --- how busy it is --------------------------------------------------------------------------- */

/* In thousandths. */
static uint32_t measure_use(enum db_medium medium)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, medium);
	uint32_t use;

	fake_pass(bus, 3000 * MS);
	use = fake_stats(bus).utilisation;
	fake_bus_free(bus);
	return use;
}

/* Three drives are read in 20 ms: on a serial line from the request to the answer, on CAN what is on the wire. */
static void how_busy_the_wire_is_shows(void **state)
{
	(void)state;
	assert_in_range(measure_use(DB_MEDIUM_SERIAL), 3 * 500 / 20 - 3, 3 * 500 / 20 + 3);
	assert_in_range(measure_use(DB_MEDIUM_CAN), 3 * 200 / 20 - 2, 3 * 200 / 20 + 2);
}

/* A frame to one drive that is not answered takes its time on the wire; one to all is waited for. */
static void frames_without_an_answer_take_their_time(void **state)
{
	uint8_t request[sizeof(struct fake_frame)] = { 0 };
	const struct db_exchange exchange = { .request = request,
		                              .request_length = sizeof request };
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_CAN);
	struct db_engine *engine = bus->engine;
	uint32_t sent = engine->stats.transactions;

	(void)state;
	engine->wire_free = bus->now - MS;
	exchange_count_unanswered(engine, &exchange, false, bus->now);
	assert_true(engine->wire_free == bus->now + FAKE_WIRE_TIME);
	exchange_count_unanswered(engine, &exchange, false, bus->now);
	assert_true(engine->wire_free == bus->now + 2 * FAKE_WIRE_TIME);
	assert_int_equal(engine->stats.transactions, sent + 2);
	exchange_count_unanswered(engine, &exchange, true, bus->now);
	assert_true(engine->quiet_until <= bus->now);
	fake_bus_free(bus);
	bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	exchange_count_unanswered(bus->engine, &exchange, true, bus->now);
	assert_true(bus->engine->quiet_until == bus->now + 2 * MS + FAKE_WIRE_TIME);
	fake_bus_free(bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_line_is_kept_for_the_first_of_several_stops),
		cmocka_unit_test(nothing_long_begins_while_a_drive_may_move),
		cmocka_unit_test(on_can_nothing_is_too_long),
		cmocka_unit_test(how_busy_the_wire_is_shows),
		cmocka_unit_test(frames_without_an_answer_take_their_time),
	};

	return cmocka_run_group_tests_name("sched/reserved", tests, NULL, NULL);
}
