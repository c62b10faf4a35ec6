/* SPDX-License-Identifier: Apache-2.0 */
/* What the schedule says of each frame in the trace of its bus. */
#include "fakes/bus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define MS DB_NS_PER_MS

static struct fake_bus *bus;
static struct db_trace_place place;
static struct db_trace_record record;
static struct fake_frame asked; /* that the drive keeps its answer to */
static bool keeps;

static db_time obey(void *context, struct fake_frame *frame)
{
	(void)context;
	if (frame->kind == FAKE_POLL && keeps) {
		asked = *frame;
		keeps = false;
		return 0;
	}
	return MS;
}

static int begin(void **state)
{
	(void)state;
	bus = fake_bus_new(&fake_family, 2);
	bus->obey = obey;
	fake_bus_open(bus, 2, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 200 * MS);
	place = db_trace_end(db_engine_trace(bus->engine));
	return 0;
}

static int end(void **state)
{
	(void)state;
	fake_bus_free(bus);
	return 0;
}

/* The next record of this kind, as soon as it is there. */
static void find(enum db_trace_kind kind)
{
	uint32_t missed;

	for (int wait = 0; wait < 500;) {
		if (!db_trace_read(db_engine_trace(bus->engine), &place, &record, &missed)) {
			fake_pass(bus, MS / 10);
			wait++;
		} else if (record.kind == kind) {
			return;
		}
	}
	fail_msg("there is no %s", db_trace_kind_name(kind));
}

static unsigned address_of(void)
{
	return fake_frame_at(record.bytes, record.length).address;
}

static void an_answer_refers_to_its_question(void **state)
{
	struct db_trace_record question;

	(void)state;
	fake_pass(bus, 50 * MS);
	for (int i = 0; i < 4; i++) {
		find(DB_TRACE_POLL);
		question = record;
		find(DB_TRACE_ANSWER);
		assert_int_equal(record.question, question.number);
		assert_true(record.time == question.time + MS);
		assert_int_equal(address_of(),
		                 fake_frame_at(question.bytes, question.length).address);
	}
}

static void a_question_that_is_given_up_is_told_and_its_late_answer_too(void **state)
{
	uint32_t question;

	(void)state;
	keeps = true;
	while (keeps)
		fake_pass(bus, MS / 10);
	find(DB_TRACE_POLL);
	question = record.number;
	assert_int_equal(address_of(), asked.address);
	find(DB_TRACE_UNANSWERED);
	assert_int_equal(record.question, question);
	assert_int_equal(record.length, 0);
	/* What is asked next is whether it is there. */
	find(DB_TRACE_PROBE);
	assert_int_equal(address_of(), asked.address);
	fake_receive(bus, &asked, sizeof asked);
	find(DB_TRACE_LATE);
	assert_int_equal(record.question, question);
	assert_memory_equal(record.bytes, &asked, sizeof asked);
}

static void what_nobody_asked_for_is_told_as_what_it_is(void **state)
{
	static const struct {
		struct fake_frame frame;
		enum db_trace_kind kind;
	} frames[] = {
		{ { .address = 9, .kind = FAKE_POLL }, DB_TRACE_STRAY },
		{ { .address = 0, .kind = FAKE_POLL }, DB_TRACE_BAD },
		{ { .address = 1, .kind = FAKE_FOREIGN }, DB_TRACE_FOREIGN },
	};

	(void)state;
	/* The wire is free then. */
	fake_pass(bus, 8 * MS);
	for (size_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
		fake_receive(bus, &frames[i].frame, sizeof frames[i].frame);
		find(frames[i].kind);
		assert_int_equal(record.question, 0);
		assert_memory_equal(record.bytes, &frames[i].frame, sizeof frames[i].frame);
		assert_true(record.time == bus->now);
	}
}

static void bytes_that_are_no_frame_are_told(void **state)
{
	(void)state;
	fake_pass(bus, 8 * MS);
	fake_receive(bus, "abc", 3);
	/* More may come, until something is asked. */
	fake_pass(bus, 30 * MS);
	find(DB_TRACE_GARBAGE);
	assert_int_equal(record.length, 3);
	assert_memory_equal(record.bytes, "abc", 3);
}

static void commands_and_stops_are_told_as_that(void **state)
{
	(void)state;
	fake_post(bus, 0, DB_CMD_ENABLE);
	fake_pass(bus, 20 * MS);
	find(DB_TRACE_COMMAND);
	assert_int_equal(address_of(), 1);
	fake_post(bus, 1, DB_CMD_STOP);
	fake_pass(bus, 20 * MS);
	find(DB_TRACE_STOP);
	assert_int_equal(address_of(), 2);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(an_answer_refers_to_its_question),
		TEST(a_question_that_is_given_up_is_told_and_its_late_answer_too),
		TEST(what_nobody_asked_for_is_told_as_what_it_is),
		TEST(bytes_that_are_no_frame_are_told),
		TEST(commands_and_stops_are_told_as_that),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
