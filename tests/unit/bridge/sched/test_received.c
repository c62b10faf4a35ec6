/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the engine finds frames in the bytes that arrive: several at once, in parts and among
 * garbage; and how long it awaits an answer. A made-up family in made-up time; every garbage byte
 * is GARBAGE.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define GARBAGE 0xEE
#define SILENCE (2 * MS)

/* What cut() was given last. */
static struct {
	uint8_t question[sizeof(struct fake_frame)];
	size_t question_length;
	db_time silence;
	unsigned silences;
} given;

/* What is too short is thrown away when it gets no longer. */
static void cut(const struct db_received *received, size_t *skip, size_t *length)
{
	given.question_length = received->question_length;
	given.silence = received->silence;
	given.silences += received->silence > 0;
	assert_true(received->question ? received->question_length == sizeof given.question :
	                                 received->question_length == 0);
	if (received->question)
		memcpy(given.question, received->question, received->question_length);
	*skip = 0;
	while (*skip < received->available && received->bytes[*skip] == GARBAGE)
		(*skip)++;
	*length = received->available - *skip >= sizeof(struct fake_frame) ?
	                  sizeof(struct fake_frame) :
	                  0;
	if (*length == 0 && received->silence > 0)
		*skip = received->available;
}

static void cut_nothing(const struct db_received *received, size_t *skip, size_t *length)
{
	(void)received;
	*skip = *length = 0;
}

static db_time frame_silence(const struct db_bus_config *bus)
{
	(void)bus;
	return SILENCE;
}

static struct fake_bus *open_bus(struct db_driver *driver, enum db_medium medium)
{
	struct fake_bus *bus;

	*driver = fake_family;
	driver->medium = medium;
	driver->cut = cut;
	if (medium == DB_MEDIUM_SERIAL)
		driver->frame_silence = frame_silence;
	bus = fake_bus_new(driver, 2);
	bus->config.drive_latency_ms = 100;
	fake_bus_open(bus, 2, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	/* From now on it answers what the test says. */
	bus->obey = fake_answer_nothing;
	while (bus->engine->flights > 0)
		fake_pass(bus, MS / 10);
	fake_forget_sent(bus);
	while (fake_count(bus, 1, FAKE_POLL) == 0 || bus->engine->flights == 0)
		fake_pass(bus, MS / 10);
	return bus;
}

static const struct fake_frame answer = { .address = 1, .kind = FAKE_POLL, .speed = 7.0f };

/* From `place` on the trace has `count` bytes of garbage, as they arrived. */
static void expect_garbage_in_trace(const struct fake_bus *bus, struct db_trace_place place,
                                    size_t count)
{
	const struct db_trace *trace = db_engine_trace(bus->engine);
	struct db_trace_record record;
	size_t told = 0;
	uint32_t lost;

	while (db_trace_read(trace, &place, &record, &lost)) {
		if (record.kind != DB_TRACE_GARBAGE)
			continue;
		for (size_t i = 0; i < record.length; i++)
			assert_int_equal(record.bytes[i], GARBAGE);
		told += record.length;
	}
	assert_int_equal(told, count);
}

static void an_answer_is_found_among_garbage(void **state)
{
	static const size_t before[] = { 0, 1, 7, 16, 100 };
	uint8_t bytes[256];

	(void)state;
	for (size_t i = 0; i < sizeof(before) / sizeof(before[0]); i++) {
		struct db_driver driver;
		struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
		uint32_t garbage = fake_stats(bus).garbage_bytes;
		struct db_trace_place place = db_trace_end(db_engine_trace(bus->engine));

		memset(bytes, GARBAGE, sizeof bytes);
		memcpy(bytes + before[i], &answer, sizeof answer);
		fake_receive(bus, bytes, before[i] + sizeof answer + 5);
		assert_true(fake_feedback(bus, 0).velocity == 7.0f);
		fake_pass(bus, SILENCE + MS);
		assert_int_equal(fake_stats(bus).garbage_bytes - garbage, before[i] + 5);
		expect_garbage_in_trace(bus, place, before[i] + 5);
		assert_int_equal(bus->engine->received_length, 0);
		fake_bus_free(bus);
	}
}

static void an_answer_that_comes_in_parts_is_found(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);

	(void)state;
	fake_receive(bus, &(uint8_t){ GARBAGE }, 1);
	for (size_t i = 0; i < sizeof answer; i++) {
		assert_false(fake_feedback(bus, 0).velocity == 7.0f);
		fake_receive(bus, (const uint8_t *)&answer + i, 1);
	}
	assert_true(fake_feedback(bus, 0).velocity == 7.0f);
	assert_int_equal(fake_stats(bus).timeouts, 0);
	fake_bus_free(bus);
}

/* A byte of garbage, then an answer that arrives in two parts, divided at each byte in turn. */
static void an_answer_whose_beginning_comes_with_garbage_is_found(void **state)
{
	(void)state;
	for (size_t first = 1; first < sizeof answer; first++) {
		struct db_driver driver;
		struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
		uint8_t bytes[1 + sizeof answer] = { GARBAGE };

		memcpy(bytes + 1, &answer, sizeof answer);
		fake_receive(bus, bytes, 1 + first);
		fake_receive(bus, bytes + 1 + first, sizeof answer - first);
		assert_true(fake_feedback(bus, 0).velocity == 7.0f);
		assert_int_equal(bus->engine->received_length, 0);
		fake_bus_free(bus);
	}
}

/* No frame is as long as the buffer: its bytes are dropped, and the search goes on with the next
 * byte. */
static void a_full_buffer_without_a_frame_is_dropped(void **state)
{
	static uint8_t bytes[2 * RECEIVE_MAX + 100];
	struct db_driver driver = fake_family;
	struct fake_bus *bus = fake_bus_new(&driver, 1);
	size_t come;

	(void)state;
	driver.cut = cut_nothing;
	fake_bus_open(bus, 1, NULL);
	fake_port(bus, 0);
	for (size_t i = 0; i < sizeof bytes; i++)
		bytes[i] = (uint8_t)(i % 251);
	fake_receive(bus, bytes, 10);
	fake_receive(bus, bytes + 10, sizeof bytes - 10);
	assert_int_equal(fake_stats(bus).garbage_bytes, 2 * RECEIVE_MAX);
	(void)db_engine_awaited(bus->engine, &come);
	assert_int_equal(come, 100);
	assert_memory_equal(bus->engine->received, bytes + 2 * RECEIVE_MAX, 100);
	fake_bus_free(bus);
}

/* What follows an answer at once is no answer, and is looked at all the same. */
static void frames_that_come_together_are_all_taken(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	const struct fake_frame frames[] = { answer, answer, answer };
	uint32_t stray = fake_stats(bus).stray_frames;

	(void)state;
	fake_receive(bus, frames, sizeof frames);
	assert_true(fake_feedback(bus, 0).velocity == 7.0f);
	assert_int_equal(fake_stats(bus).stray_frames - stray, 2);
	assert_int_equal(bus->engine->received_length, 0);
	fake_bus_free(bus);
}

/* The family may need it: where one drive is asked at a time. */
static void a_frame_is_cut_with_the_question_that_it_may_answer(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	const struct fake_frame *question = &bus->sent[bus->sent_count - 1].frame;

	(void)state;
	fake_receive(bus, &answer, sizeof answer);
	assert_int_equal(given.question_length, sizeof *question);
	assert_memory_equal(given.question, question, sizeof *question);
	/* None is asked now. */
	assert_int_equal(bus->engine->flights, 0);
	fake_receive(bus, &answer, sizeof answer);
	assert_int_equal(given.question_length, 0);
	fake_bus_free(bus);
	bus = open_bus(&driver, DB_MEDIUM_CAN);
	fake_receive(bus, &answer, sizeof answer);
	assert_int_equal(given.question_length, 0);
	fake_bus_free(bus);
}

/* Once, when so much time has passed without another byte. */
static void the_end_of_what_is_too_short_shows_by_silence(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	uint32_t garbage = fake_stats(bus).garbage_bytes;

	(void)state;
	given.silences = 0;
	for (unsigned i = 0; i < 4; i++) {
		fake_receive(bus, &answer, 2);
		assert_int_equal(given.silence, 0);
		fake_pass(bus, SILENCE - MS / 10);
		assert_int_equal(given.silences, 0);
	}
	fake_pass(bus, MS / 5);
	assert_int_equal(given.silences, 1);
	assert_int_equal(given.silence, SILENCE);
	assert_int_equal(fake_stats(bus).garbage_bytes - garbage, 8);
	fake_pass(bus, 10 * MS);
	assert_int_equal(given.silences, 1);
	/* A whole frame leaves nothing whose end is to be seen. */
	fake_receive(bus, &answer, sizeof answer);
	assert_int_equal(bus->engine->silent_at, 0);
	fake_pass(bus, 2 * SILENCE);
	assert_int_equal(given.silences, 1);
	/* A single byte does: the silence after it is seen to the nanosecond. */
	fake_receive(bus, &answer, 1);
	fake_pass(bus, SILENCE - 1);
	(void)db_engine_run(bus->engine, bus->now);
	assert_int_equal(given.silences, 1);
	(void)db_engine_run(bus->engine, ++bus->now);
	assert_int_equal(given.silences, 2);
	assert_int_equal(fake_stats(bus).garbage_bytes - garbage, 9);
	fake_bus_free(bus);
}

/* --- how much is awaited ---------------------------------------------------------------------- */

static void what_is_awaited_is_known(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = open_bus(&driver, DB_MEDIUM_SERIAL);
	size_t come;

	(void)state;
	fake_receive(bus, &answer, 3);
	assert_int_equal(db_engine_awaited(bus->engine, &come), sizeof answer);
	assert_int_equal(come, 3);
	/* It does not come in time: it may still come, of any length, but not for ever. */
	bus->engine->cycle_at = bus->now + 10000 * MS;
	while (bus->engine->flights > 0)
		fake_pass(bus, MS / 10);
	assert_int_equal(db_engine_awaited(bus->engine, &come), DB_ANSWER_MAX);
	bus->engine->late_until = bus->engine->now;
	assert_int_equal(db_engine_awaited(bus->engine, &come), 0);
	fake_bus_free(bus);
}

/* --- answers without an end ------------------------------------------------------------------- */

static enum db_step begin_open_ended(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	talk->exchange->open_ended = true;
	talk->exchange->extra_time = 20 * MS;
	return step;
}

static db_time take_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	(void)request_length;
	return (db_time)answer_length * (100 * MS / DB_ANSWER_MAX);
}

static db_time answer_as_first(void *context, struct fake_frame *frame)
{
	(void)context;
	return frame->address == 1 ? FAKE_ANSWER_TIME : 0;
}

/* How long the second drive's answer is awaited: so many bytes of it arrive after 90 ms, and where
 * it goes on, another byte every 50 ms. */
static db_time wait_for(bool open_ended, size_t bytes, bool goes_on)
{
	const uint8_t part[DB_ANSWER_MAX] = { 0 };
	struct db_transport transport = fake_wire;
	struct db_driver driver = fake_family;
	struct fake_bus *bus;
	db_time sent;

	transport.wire_time = take_time;
	bus = fake_bus_new(&driver, 2);
	bus->config.transport = &transport;
	bus->config.drive_latency_ms = 100;
	fake_bus_open(bus, 2, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	bus->obey = answer_as_first;
	if (open_ended)
		driver.begin = begin_open_ended;
	fake_forget_sent(bus);
	while (fake_count(bus, 2, FAKE_POLL) == 0 || bus->engine->flights == 0)
		fake_pass(bus, MS / 10);
	driver.cut = cut_nothing;
	sent = bus->sent[bus->sent_count - 1].at;
	fake_pass(bus, sent + 90 * MS - bus->now);
	fake_receive(bus, part, bytes);
	for (unsigned i = 1; fake_stats(bus).timeouts == 0; i++) {
		assert_true(i < 1000);
		if (goes_on && i % 50 == 0)
			fake_receive(bus, part, 1);
		fake_pass(bus, MS);
	}
	sent = bus->now - sent;
	fake_bus_free(bus);
	return sent;
}

static void an_answer_without_an_end_is_awaited_while_it_comes(void **state)
{
	(void)state;
	/* What is short may be anything. */
	assert_in_range(wait_for(true, 256, true), 119 * MS, 130 * MS);
	/* And so is what is not awaited. */
	assert_in_range(wait_for(false, 300, true), 99 * MS, 110 * MS);
	assert_in_range(wait_for(true, 257, false), 188 * MS, 195 * MS);
	/* As long as the longest answer may take, and the drive to begin it. */
	assert_in_range(wait_for(true, 300, true), 188 * MS, 202 * MS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_answer_is_found_among_garbage),
		cmocka_unit_test(an_answer_that_comes_in_parts_is_found),
		cmocka_unit_test(an_answer_whose_beginning_comes_with_garbage_is_found),
		cmocka_unit_test(a_full_buffer_without_a_frame_is_dropped),
		cmocka_unit_test(frames_that_come_together_are_all_taken),
		cmocka_unit_test(a_frame_is_cut_with_the_question_that_it_may_answer),
		cmocka_unit_test(the_end_of_what_is_too_short_shows_by_silence),
		cmocka_unit_test(what_is_awaited_is_known),
		cmocka_unit_test(an_answer_without_an_end_is_awaited_while_it_comes),
	};

	return cmocka_run_group_tests_name("sched/received", tests, NULL, NULL);
}
