/* SPDX-License-Identifier: Apache-2.0 */
/*
 * When the engine asks to be called again: as soon as something can be sent, and not before. And
 * how it treats delays of its thread. The drives, the line and the time are simulated
 * (fakes/bus.h).
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define GAP (5 * MS)

/* Opens a bus on which nothing is under way, and nothing is due for ten seconds. */
static struct fake_bus *open_idle_bus(struct db_driver *driver, size_t drives)
{
	struct fake_bus *bus = fake_bus_new(driver, drives);

	fake_bus_open(bus, drives, NULL);
	fake_port(bus, 0);
	fake_settle(bus);
	fake_forget_sent(bus);
	return bus;
}

/* The first drive has just answered, and cannot receive for the time GAP. */
static void make_deaf(struct fake_bus *bus)
{
	struct node *node = bus->engine->nodes[0];

	node->gap.now = GAP;
	node->answered_at = bus->now;
}

static void a_request_is_sent_as_soon_as_its_drive_can_receive(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 1);
	db_time posted = bus->now;

	(void)state;
	make_deaf(bus);
	fake_post(bus, 0, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(bus, 50 * MS);
	assert_int_equal(fake_count(bus, 1, FAKE_COMMAND), 1);
	assert_int_equal(bus->sent[0].frame.kind, FAKE_COMMAND);
	assert_int_equal(bus->sent[0].at, posted + GAP);
	fake_bus_free(bus);
}

static void a_drive_is_read_as_soon_as_it_can_receive(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 1);
	db_time since = bus->now;

	(void)state;
	make_deaf(bus);
	bus->engine->cycle_at = bus->now + MS;
	bus->engine->idle_until = 0;
	fake_pass(bus, 19 * MS);
	assert_int_equal(bus->sent_count, 1);
	assert_int_equal(bus->sent[0].frame.kind, FAKE_POLL);
	assert_int_equal(bus->sent[0].at, since + GAP);
	fake_bus_free(bus);
}

/* Nothing is to be sent to the first drive. The next event is the probe of the other one, which
 * is offline. */
static void a_drive_that_can_receive_again_does_not_wake_the_thread(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 2);
	struct db_engine *engine = bus->engine;

	(void)state;
	make_deaf(bus);
	engine->nodes[1]->online = false;
	engine->stats.online--;
	engine->nodes[1]->probe_at = bus->now + 1000 * MS;
	engine->idle_until = 0;
	assert_int_equal(db_engine_run(engine, bus->now), engine->nodes[1]->probe_at);
	fake_bus_free(bus);
}

/* The port was lost and is open again: whether the drive is still there is checked as soon as it
 * can receive. */
static void a_drive_is_probed_as_soon_as_it_can_receive(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 1);
	db_time since = bus->now;

	(void)state;
	fake_port(bus, 5);
	make_deaf(bus);
	fake_port(bus, 0);
	assert_int_equal(db_engine_run(bus->engine, bus->now), since + GAP);
	fake_pass(bus, GAP + MS);
	assert_int_equal(bus->sent[0].frame.kind, FAKE_PROBE);
	assert_int_equal(bus->sent[0].at, since + GAP);
	fake_bus_free(bus);
}

static enum db_step look_again(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	if (fake_frame_at(bytes, length).kind != FAKE_COMMAND)
		return fake_family.answer(talk, bytes, length);
	(void)fake_say(talk, FAKE_COMMAND);
	talk->exchange->again = true;
	return DB_STEP_SEND;
}

/* Nothing else is to be sent, so the pause is the shortest one. */
static void a_question_is_repeated_after_a_pause(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 1);

	(void)state;
	driver.answer = look_again;
	fake_post(bus, 0, DB_CMD_ENABLE);
	fake_pass(bus, 50 * MS);
	assert_true(bus->sent_count > 20);
	for (size_t i = 2; i < bus->sent_count; i++) {
		assert_int_equal(bus->sent[i].frame.kind, FAKE_COMMAND);
		assert_int_equal(bus->sent[i].at - bus->sent[i - 1].at, SCHEDULE_AGAIN_PAUSE);
	}
	fake_bus_free(bus);
}

static unsigned begun;

static enum db_step end_at_once(struct db_conversation *talk)
{
	if (talk->job->kind != DB_JOB_PROBE)
		return fake_family.begin(talk);
	begun++;
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

/* If the driver's jobs end without sending anything, the engine must return soon: a stop may
 * have arrived in the meantime. */
static void jobs_that_send_nothing_do_not_keep_the_thread(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 1);

	(void)state;
	driver.begin = end_at_once;
	begun = 0;
	bus->engine->nodes[0]->in_step = false;
	fake_post(bus, 0, DB_CMD_ENABLE);
	for (unsigned i = 1; i <= 3; i++) {
		assert_int_equal(db_engine_run(bus->engine, bus->now), bus->now + 1);
		assert_in_range(begun, i * 2, i * 6);
		bus->now++;
	}
	fake_bus_free(bus);
}

/* --- delays of the thread --------------------------------------------------------------------- */

/* A delay counts from 2 ms on, and only once, even if several calls follow it. */
static void a_delay_of_the_thread_is_counted_once(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = open_idle_bus(&driver, 1);
	const uint64_t before = fake_stats(bus).overslept_us;

	(void)state;
	bus->now = db_engine_run(bus->engine, bus->now) + 2 * MS - 1;
	fake_receive(bus, "", 0);
	assert_int_equal(fake_stats(bus).overslept_us, before);
	bus->now++;
	for (unsigned i = 0; i < 3; i++)
		fake_receive(bus, "", 0);
	(void)db_engine_run(bus->engine, bus->now);
	assert_int_equal(fake_stats(bus).overslept_us, before + 2000);
	fake_bus_free(bus);
}

/* --- an answer that has begun ----------------------------------------------------------------- */

static db_time take_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * MS;
}

/* The first byte arrives just at the timeout. The rest is awaited once, for the time of a whole
 * answer; the time at which the answer was due stays the same. */
static void the_rest_of_an_answer_is_awaited(void **state)
{
	struct db_transport transport = fake_wire;
	struct db_driver driver = fake_family;
	const db_time wire = 2 * (db_time)sizeof(struct fake_frame) * MS;
	struct fake_bus *bus;
	const struct node *node;
	db_time sent;

	(void)state;
	transport.wire_time = take_time;
	bus = fake_bus_new(&driver, 1);
	bus->config.transport = &transport;
	fake_bus_open(bus, 1, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	bus->obey = fake_answer_nothing;
	while (bus->engine->flights > 0)
		fake_pass(bus, MS / 10);
	fake_forget_sent(bus);
	while (bus->engine->flights == 0)
		fake_pass(bus, MS / 10);
	sent = bus->sent[0].at;
	node = bus->engine->nodes[0];
	/* The last moment before the timeout. */
	fake_pass(bus, sent + wire + node->patience.now - bus->now);
	fake_receive(bus, "", 1);
	fake_pass(bus, wire / 2 - 1);
	(void)db_engine_run(bus->engine, bus->now);
	assert_int_equal(fake_stats(bus).timeouts, 0);
	(void)db_engine_run(bus->engine, ++bus->now);
	assert_int_equal(fake_stats(bus).timeouts, 1);
	assert_int_equal(node->lost_due, sent + wire);
	fake_bus_free(bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_request_is_sent_as_soon_as_its_drive_can_receive),
		cmocka_unit_test(a_drive_is_read_as_soon_as_it_can_receive),
		cmocka_unit_test(a_drive_that_can_receive_again_does_not_wake_the_thread),
		cmocka_unit_test(a_drive_is_probed_as_soon_as_it_can_receive),
		cmocka_unit_test(a_question_is_repeated_after_a_pause),
		cmocka_unit_test(jobs_that_send_nothing_do_not_keep_the_thread),
		cmocka_unit_test(a_delay_of_the_thread_is_counted_once),
		cmocka_unit_test(the_rest_of_an_answer_is_awaited),
	};

	return cmocka_run_group_tests_name("sched/engine_wakes", tests, NULL, NULL);
}
