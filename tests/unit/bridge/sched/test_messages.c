/* SPDX-License-Identifier: Apache-2.0 */
/* What a bus itself sends, whatever its drives do: when, and which number each has. */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define SYNC_MS 10
/* Longer than a message may wait for the exchange that is under way. */
#define WAIT (3 * MS)

/* Which of the messages a frame is, in `axis`; its number is the target. */
enum { START, SYNC, NOT_HERE };

static void write_message(struct db_exchange *exchange, uint8_t which, uint32_t number)
{
	const struct fake_frame frame = {
		.address = FAKE_ALL, .kind = FAKE_FOREIGN, .axis = which, .target = (int32_t)number
	};

	memcpy(exchange->request, &frame, sizeof(frame));
	exchange->request_length = sizeof(frame);
}

static void write_start(const struct db_bus_config *bus, uint32_t number,
                        struct db_exchange *exchange)
{
	(void)bus;
	write_message(exchange, START, number);
}

static void write_sync(const struct db_bus_config *bus, uint32_t number,
                       struct db_exchange *exchange)
{
	(void)bus;
	write_message(exchange, SYNC, number);
}

static void write_other(const struct db_bus_config *bus, uint32_t number,
                        struct db_exchange *exchange)
{
	(void)bus;
	write_message(exchange, NOT_HERE, number);
}

static db_time once(const struct db_bus_config *bus)
{
	(void)bus;
	return DB_TIME_NEVER;
}

static db_time often(const struct db_bus_config *bus)
{
	(void)bus;
	return SYNC_MS * MS;
}

static db_time never(const struct db_bus_config *bus)
{
	(void)bus;
	return 0;
}

static const struct db_bus_message messages[] = { { "start", once, write_start },
	                                          { "sync", often, write_sync },
	                                          { "other", never, write_other } };

static struct db_driver family;

static struct fake_bus *open_bus(void)
{
	struct fake_bus *bus;

	family = fake_family;
	family.messages = messages;
	family.message_count = 3;
	bus = fake_bus_new(&family, 1);
	fake_bus_open(bus, 1, NULL);
	fake_port(bus, 0);
	return bus;
}

/* How often this message was sent; its numbers follow each other from 0 on, the first one comes `first` after the
 * beginning, at most WAIT late, the others a period later each. */
static unsigned count(const struct fake_bus *bus, uint8_t which, db_time begin)
{
	unsigned found = 0;

	for (size_t i = 0; i < bus->sent_count; i++) {
		const struct fake_sent *sent = &bus->sent[i];

		if (sent->frame.kind != FAKE_FOREIGN || sent->frame.axis != which)
			continue;
		assert_int_equal(sent->frame.target, found);
		assert_in_range(sent->at - begin, found * SYNC_MS * MS,
		                found * SYNC_MS * MS + WAIT);
		found++;
	}
	return found;
}

static void each_is_sent_when_its_time_comes(void **state)
{
	struct fake_bus *bus = open_bus();

	(void)state;
	fake_pass(bus, 205 * MS);
	assert_int_equal(count(bus, START, FAKE_BEGIN_TIME), 1);
	assert_int_equal(count(bus, SYNC, FAKE_BEGIN_TIME), 21);
	assert_int_equal(count(bus, NOT_HERE, FAKE_BEGIN_TIME), 0);
	/* And drives are read as before. */
	assert_true(fake_is_online(bus, 0));
	assert_in_range(fake_count(bus, 1, FAKE_POLL), 9, 11);
	fake_bus_free(bus);
}

static void numbers_begin_anew_when_the_port_is_opened_again(void **state)
{
	struct fake_bus *bus = open_bus();
	db_time opened;

	(void)state;
	fake_pass(bus, 55 * MS);
	fake_port(bus, 5);
	fake_forget_sent(bus);
	fake_pass(bus, 55 * MS);
	/* Nothing is sent meanwhile. */
	assert_int_equal(bus->sent_count, 0);
	opened = bus->now;
	fake_port(bus, 0);
	fake_pass(bus, 55 * MS);
	assert_int_equal(count(bus, START, opened), 1);
	assert_int_equal(count(bus, SYNC, opened), 6);
	fake_bus_free(bus);
}

/* The port took nothing for longer than a period: what was missed is not made up for. */
static void one_that_is_late_is_sent_once(void **state)
{
	struct fake_bus *bus = open_bus();
	unsigned sent = 0;
	db_time last = 0;

	(void)state;
	fake_pass(bus, 55 * MS);
	db_engine_hold(bus->engine, true, bus->now);
	fake_forget_sent(bus);
	fake_pass(bus, 38 * MS);
	assert_int_equal(bus->sent_count, 0);
	db_engine_hold(bus->engine, false, bus->now);
	fake_pass(bus, 35 * MS);
	for (size_t i = 0; i < bus->sent_count; i++) {
		if (bus->sent[i].frame.kind != FAKE_FOREIGN)
			continue;
		assert_int_equal(bus->sent[i].frame.axis, SYNC);
		assert_int_equal(bus->sent[i].frame.target, 6 + sent);
		if (sent++ > 0)
			assert_in_range(bus->sent[i].at - last, SYNC_MS * MS - WAIT,
			                SYNC_MS * MS + WAIT);
		last = bus->sent[i].at;
	}
	assert_int_equal(sent, 4);
	fake_bus_free(bus);
}

/* A stop waits for none of them, but they wait for a stop. */
static void messages_and_stops_share_the_wire(void **state)
{
	struct fake_bus *bus = open_bus();

	(void)state;
	fake_pass(bus, 300 * MS);
	for (unsigned i = 0; i < 20; i++) {
		fake_forget_sent(bus);
		fake_post(bus, 0, DB_CMD_STOP);
		fake_pass(bus, 7 * MS);
		assert_int_equal(fake_count(bus, 1, FAKE_STOP), 1);
		fake_pass(bus, 30 * MS);
		assert_int_equal(fake_result(bus), DB_RESULT_OK);
	}
	fake_bus_free(bus);
}

static void what_they_take_is_part_of_the_load(void **state)
{
	struct fake_bus *with = open_bus();
	struct fake_bus *without = fake_bus_new(&fake_family, 1);

	(void)state;
	fake_bus_open(without, 1, NULL);
	fake_port(without, 0);
	fake_pass(with, 3000 * MS);
	fake_pass(without, 3000 * MS);
	assert_true(fake_stats(with).utilisation > fake_stats(without).utilisation);
	fake_bus_free(with);
	fake_bus_free(without);
}

static const struct db_bus_message sync_first[] = { { "sync", often, write_sync },
	                                            { "start", once, write_start } };

static void the_next_message_is_due_a_period_after_this_one_was_due(void **state)
{
	struct fake_bus *bus = fake_bus_new(&family, 1);
	struct db_engine *engine;
	db_time begun = bus->now;

	(void)state;
	family = fake_family;
	family.messages = sync_first;
	family.message_count = 2;
	fake_bus_open(bus, 1, NULL);
	engine = bus->engine;
	messages_begin(engine, begun);
	assert_int_equal(engine->next_message_at, begun);
	assert_true(messages_send(engine, begun));
	assert_int_equal(engine->next_message_at, begun);
	/* This was the start message, which is sent only once. */
	assert_true(messages_send(engine, begun));
	assert_int_equal(engine->next_message_at, begun + SYNC_MS * MS);
	/* Sent a little late, the next one is due a period after this one was due; sent late by a
	 * whole period, it is due a period from now. */
	assert_true(messages_send(engine, begun + (SYNC_MS + 3) * MS));
	assert_int_equal(engine->next_message_at, begun + 2 * SYNC_MS * MS);
	assert_true(messages_send(engine, begun + 3 * SYNC_MS * MS - 1));
	assert_int_equal(engine->next_message_at, begun + 3 * SYNC_MS * MS);
	assert_true(messages_send(engine, begun + 4 * SYNC_MS * MS));
	assert_int_equal(engine->next_message_at, begun + 5 * SYNC_MS * MS);
	fake_bus_free(bus);
}

/* On a serial line the bus is silent after a message for longer than it takes on the wire, so that
 * drives can act on it; on CAN the next frame only waits until the wire is free. */
static void nothing_is_sent_during_a_message(void **state)
{
	(void)state;
	for (unsigned can = 0; can < 2; can++) {
		struct fake_bus *bus = fake_bus_new(&family, 1);
		db_time begun = bus->now;

		family = fake_family;
		family.messages = sync_first;
		family.message_count = 2;
		family.medium = can ? DB_MEDIUM_CAN : DB_MEDIUM_SERIAL;
		fake_bus_open(bus, 1, NULL);
		messages_begin(bus->engine, begun);
		assert_true(messages_send(bus->engine, begun));
		assert_int_equal(bus->engine->quiet_until > begun + FAKE_WIRE_TIME, !can);
		assert_int_equal(bus->engine->wire_free == begun + FAKE_WIRE_TIME, can);
		assert_int_equal(fake_stats(bus).transactions, 1);
		fake_bus_free(bus);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_is_sent_when_its_time_comes),
		cmocka_unit_test(numbers_begin_anew_when_the_port_is_opened_again),
		cmocka_unit_test(one_that_is_late_is_sent_once),
		cmocka_unit_test(the_next_message_is_due_a_period_after_this_one_was_due),
		cmocka_unit_test(nothing_is_sent_during_a_message),
		cmocka_unit_test(messages_and_stops_share_the_wire),
		cmocka_unit_test(what_they_take_is_part_of_the_load),
	};

	return cmocka_run_group_tests_name("sched: messages of the bus itself", tests, NULL, NULL);
}
