/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One question of a scan: when it is sent, how long the scan waits for the answer, and how it
 * judges the received bytes. The drives, the time and the line are simulated (fakes/bus.h). On that
 * line a byte takes 100 us.
 */
#include "fakes/bus.h"
#include "sched/scan.h"
#include "sched/sched_private.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define BYTE (MS / 10)
#define FRAME ((db_time)sizeof(struct fake_frame) * BYTE)
#define LATENCY (8 * MS)
#define EXTRA (3 * MS)
#define TURNAROUND (2 * MS)
#define QUIET (1 * MS) /* this one and the next two as in scan.c */
#define MARGIN (1 * MS)
#define WAIT_MIN (5 * MS)
#define GARBAGE 0xEE
#define STRANGER 5 /* an address without a drive */

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	struct db_transport transport;
	struct db_engine *engine;
	struct scan *scan;
};

static db_time take_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * BYTE;
}

static bool inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                    struct db_exchange *exchange)
{
	(void)bus;
	fake_write_inquiry(inquiry, exchange);
	exchange->extra_time = EXTRA;
	return true;
}

/* The target of an answer is the result: one of enum db_recognised. */
static enum db_recognised recognise(const struct db_bus_config *bus,
                                    const struct db_inquiry *inquiry, const uint8_t *bytes,
                                    size_t length, struct db_inquired *said)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	(void)bus;
	(void)said;
	if (frame.kind != FAKE_INQUIRY || frame.address != inquiry->address)
		return DB_RECOGNISED_NOTHING;
	return (enum db_recognised)frame.target;
}

/* Skips garbage. The bytes after it are a frame as soon as there are enough of them. */
static void cut(const struct db_received *received, size_t *skip, size_t *length)
{
	*skip = 0;
	while (*skip < received->available && received->bytes[*skip] == GARBAGE)
		(*skip)++;
	*length = received->available - *skip >= sizeof(struct fake_frame) ?
	                  sizeof(struct fake_frame) :
	                  0;
}

static void cut_nothing(const struct db_received *received, size_t *skip, size_t *length)
{
	(void)received;
	*skip = *length = 0;
}

/* Opens a bus with two drives that have nothing to do for ten seconds and do not answer. */
static void open_world(struct world *world, enum db_medium medium)
{
	memset(world, 0, sizeof *world);
	world->driver = fake_family;
	world->driver.medium = medium;
	world->driver.inquire = inquire;
	world->driver.recognise = recognise;
	world->transport = fake_wire;
	world->bus = fake_bus_new(&world->driver, 2);
	world->bus->config.drive_latency_ms = LATENCY / MS;
	world->bus->config.turnaround_us = TURNAROUND / DB_NS_PER_US;
	world->bus->config.baud = 115200;
	world->bus->config.bitrate = 500000;
	fake_bus_open(world->bus, 2, NULL);
	world->engine = world->bus->engine;
	fake_port(world->bus, 0);
	fake_settle(world->bus);
	world->transport.wire_time = take_time;
	world->bus->config.transport = &world->transport;
	world->bus->obey = fake_answer_nothing;
	fake_forget_sent(world->bus);
}

static void begin_plan(struct world *world, struct db_scan_plan plan)
{
	world->scan = scan_new(&world->bus->config, &plan, 77);
	assert_non_null(world->scan);
	assert_int_equal(world->scan->number, 77);
	scan_begin(world->engine, world->scan, world->bus->now);
}

/* Begins a scan of this address and the next one, and sends its first question. */
static void ask(struct world *world, enum db_medium medium, unsigned address)
{
	open_world(world, medium);
	begin_plan(world, (struct db_scan_plan){ .first = address, .last = address + 1 });
	assert_true(scan_send_next(world->engine, world->bus->now));
	assert_true(world->scan->question.flying);
}

/* Sends the next question of the same scan. */
static void ask_next(struct world *world)
{
	world->bus->now = db_time_max(world->bus->now, world->engine->quiet_until);
	world->scan->not_before = 0;
	assert_true(scan_send_next(world->engine, world->bus->now));
}

static void close_world(struct world *world)
{
	scan_end(world->engine, DB_SCAN_CANCELLED);
	scan_free(world->scan);
	fake_bus_free(world->bus);
}

static void receive_inquired(struct world *world, unsigned address, enum db_recognised what)
{
	const struct fake_frame frame = { .address = (uint8_t)address,
		                          .kind = FAKE_INQUIRY,
		                          .target = (int32_t)what };

	fake_receive(world->bus, &frame, sizeof frame);
}

static struct db_scan_progress progress_of(const struct world *world)
{
	struct db_scan_progress progress;

	db_seqlock_read(&world->scan->sequence, world->scan->words, &progress, sizeof(progress));
	return progress;
}

/* True if the question has ended at this time. */
static bool is_over(struct world *world, db_time now)
{
	world->bus->now = now;
	world->engine->now = now;
	scan_check(world->engine, now);
	return !world->scan->question.flying;
}

/* --- asking ----------------------------------------------------------------------------------- */

static void a_question_takes_its_time_on_the_wire(void **state)
{
	struct world world;
	const struct question *question;
	uint32_t before;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	before = fake_stats(world.bus).transactions;
	world.engine->received_length = 3;
	begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER + 1 });
	assert_int_equal(scan_run_at(world.engine, world.bus->now), DB_TIME_NEVER);
	assert_true(scan_send_next(world.engine, world.bus->now));
	question = &world.scan->question;
	assert_int_equal(question->silent_by, world.bus->now + FRAME + EXTRA + LATENCY);
	assert_int_equal(question->deadline, question->silent_by + FRAME);
	assert_int_equal(scan_run_at(world.engine, world.bus->now), question->silent_by);
	assert_int_equal(world.scan->cycle_used, world.engine->cycle_at);
	assert_int_equal(world.scan->progress.address, STRANGER);
	assert_int_equal(fake_stats(world.bus).transactions, before + 1);
	assert_int_equal(world.engine->flights, 1);
	/* Bytes that were received before the question do not answer it. */
	assert_int_equal(world.engine->received_length, 0);
	assert_int_equal(fake_stats(world.bus).garbage_bytes, 3);
	close_world(&world);
}

/* On CAN the question takes its turn on the wire after the frames that were sent before it. */
static void a_question_on_can_waits_for_the_wire(void **state)
{
	(void)state;
	for (unsigned busy = 0; busy < 2; busy++) {
		struct world world;
		db_time free_at;

		open_world(&world, DB_MEDIUM_CAN);
		free_at = world.bus->now + (busy ? 4 * MS : 0);
		world.engine->wire_free = busy ? free_at : 0;
		/* On CAN a question need not end before the next cycle. */
		world.engine->cycle_at = world.bus->now + MS;
		begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER });
		assert_true(scan_send_next(world.engine, world.bus->now));
		assert_int_equal(world.engine->wire_free, free_at + 2 * FRAME);
		assert_int_equal(world.engine->flights, 0);
		assert_int_equal(world.scan->question.silent_by,
		                 world.bus->now + FRAME + EXTRA + LATENCY);
		close_world(&world);
	}
}

/* True if a question is sent when the drive has `room` to respond before the next cycle. */
static bool asks_with_room(struct world *world, db_time room)
{
	open_world(world, DB_MEDIUM_SERIAL);
	begin_plan(world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER + 1 });
	world->engine->cycle_at = world->bus->now + 2 * FRAME + EXTRA + room + MARGIN + QUIET +
	                          TURNAROUND;
	return scan_send_next(world->engine, world->bus->now);
}

static void a_question_ends_before_the_next_cycle(void **state)
{
	struct world world;

	(void)state;
	assert_false(asks_with_room(&world, WAIT_MIN - 1));
	assert_int_equal(world.scan->progress.needed_us,
	                 (2 * FRAME + EXTRA + WAIT_MIN + MARGIN + QUIET + TURNAROUND) /
	                         DB_NS_PER_US);
	close_world(&world);
	assert_true(asks_with_room(&world, WAIT_MIN));
	assert_int_equal(world.scan->question.silent_by, world.bus->now + FRAME + EXTRA + WAIT_MIN);
	/* The progress shows the shortest wait: a drive that responds later is not found. */
	assert_int_equal(world.scan->progress.wait_us, WAIT_MIN / DB_NS_PER_US);
	close_world(&world);
	assert_true(asks_with_room(&world, LATENCY + MS));
	assert_int_equal(world.scan->question.silent_by, world.bus->now + FRAME + EXTRA + LATENCY);
	assert_int_equal(world.scan->progress.wait_us, LATENCY / DB_NS_PER_US);
	close_world(&world);
}

/* A second question in one cycle is sent only if the drive has the full latency to respond. */
static void each_address_gets_the_same_wait(void **state)
{
	for (unsigned more = 0; more < 2; more++) {
		struct world world;
		db_time now;

		(void)state;
		assert_true(asks_with_room(&world, 3 * LATENCY));
		assert_true(is_over(&world, world.scan->question.silent_by));
		now = world.bus->now = world.engine->quiet_until;
		world.engine->cycle_at = now + 2 * FRAME + EXTRA + LATENCY - 1 + more + MARGIN +
		                         QUIET + TURNAROUND;
		world.scan->cycle_used = world.engine->cycle_at;
		assert_int_equal(scan_send_next(world.engine, now), more);
		close_world(&world);
	}
}

/* Once a drive has answered, its response time is known, and a question needs room for twice
 * that time and a margin. The wait that is shown for other drives stays as it was. */
static void a_drive_that_has_answered_needs_less_time(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	world.bus->now += 2 * FRAME + MS;
	receive_inquired(&world, STRANGER, DB_RECOGNISED_ANSWER);
	assert_int_equal(world.scan->question.outcome.time_us, (2 * FRAME + MS) / DB_NS_PER_US);
	assert_true(is_over(&world, world.scan->question.deadline));
	assert_true(world.scan->response_known);
	assert_int_equal(world.scan->response_time, MS);
	world.bus->now = world.engine->quiet_until;
	world.engine->cycle_at = world.bus->now + 2 * FRAME + EXTRA + 3 * MS + MARGIN + QUIET +
	                         TURNAROUND;
	assert_true(scan_send_next(world.engine, world.bus->now));
	assert_int_equal(world.scan->progress.needed_us,
	                 (2 * FRAME + EXTRA + 3 * MS + MARGIN + QUIET + TURNAROUND) / DB_NS_PER_US);
	assert_int_equal(world.scan->question.silent_by, world.bus->now + FRAME + EXTRA + 3 * MS);
	assert_int_equal(world.scan->progress.wait_us, LATENCY / DB_NS_PER_US);
	/* The shortest response time counts: a slower answer does not change it, a faster one
	 * does. */
	world.bus->now += 2 * FRAME + 2 * MS;
	receive_inquired(&world, STRANGER, DB_RECOGNISED_ANSWER);
	assert_true(is_over(&world, world.scan->question.deadline + QUIET));
	assert_int_equal(world.scan->response_time, MS);
	world.engine->cycle_at += 10000 * MS;
	ask_next(&world);
	world.bus->now += FRAME;
	receive_inquired(&world, STRANGER, DB_RECOGNISED_ANSWER);
	assert_true(is_over(&world, world.scan->question.deadline));
	assert_int_equal(world.scan->response_time, 0);
	/* Answers to other kinds of questions have other lengths, so their time does not count. */
	ask_next(&world);
	world.scan->response_time = 2 * MS;
	world.scan->question.inquiry.kind = DB_INQUIRY_IDENTITY;
	world.bus->now += 2 * FRAME + MS;
	receive_inquired(&world, STRANGER, DB_RECOGNISED_ANSWER);
	assert_true(is_over(&world, world.scan->question.deadline));
	assert_int_equal(world.scan->response_time, 2 * MS);
	close_world(&world);
}

static void at_the_next_address_the_response_time_is_unknown_again(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	world.scan->response_known = true;
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(world.scan->question.inquiry.address, STRANGER);
		assert_true(is_over(&world, world.scan->question.silent_by));
		ask_next(&world);
	}
	assert_int_equal(world.scan->question.inquiry.address, STRANGER + 1);
	assert_false(world.scan->response_known);
	assert_int_equal(progress_of(&world).asked, 1);
	close_world(&world);
}

/* A question that changes a setting is sent at once, like a command. */
static void a_setting_may_take_longer_than_a_cycle(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	begin_plan(&world, (struct db_scan_plan){ .first = STRANGER,
	                                          .last = STRANGER,
	                                          .set_up = DB_INQUIRY_SET_ADDRESS });
	visit_begin(&world.scan->visit, &world.driver, 9600, STRANGER, DB_INQUIRY_SET_ADDRESS, 6);
	world.scan->visiting = true;
	world.scan->visit.asked = world.scan->visit.find.answered = 3;
	world.scan->visit.standings = world.scan->visit.axes;
	world.engine->cycle_at = world.bus->now + MS;
	assert_true(scan_send_next(world.engine, world.bus->now));
	assert_int_equal(world.scan->question.inquiry.kind, DB_INQUIRY_SET_ADDRESS);
	close_world(&world);
}

/* A save may delay a stop. So it waits until each drive of the line was read after its last
 * command, also the first drive. */
static void nothing_is_saved_before_each_drive_was_read(void **state)
{
	(void)state;
	for (size_t unread = 0; unread < 3; unread++) {
		struct world world;

		open_world(&world, DB_MEDIUM_SERIAL);
		begin_plan(&world, (struct db_scan_plan){ .first = STRANGER,
		                                          .last = STRANGER,
		                                          .set_up = DB_INQUIRY_SAVE });
		visit_begin(&world.scan->visit, &world.driver, 9600, STRANGER, DB_INQUIRY_SAVE, 0);
		world.scan->visiting = true;
		world.scan->visit.asked = world.scan->visit.find.answered = 3;
		world.scan->visit.standings = world.scan->visit.axes;
		if (unread < 2)
			world.engine->stations[unread]->command_ended = world.bus->now;
		assert_int_equal(scan_send_next(world.engine, world.bus->now), unread == 2);
		close_world(&world);
	}
}

static void a_question_is_asked_as_soon_as_it_may_be(void **state)
{
	struct world world;

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		open_world(&world, DB_MEDIUM_SERIAL);
		begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER });
		world.engine->reserved.until = i == 0 ? world.bus->now : 0;
		world.scan->not_before = i == 1 ? world.bus->now : 0;
		world.engine->quiet_until = i == 2 ? world.bus->now : 0;
		assert_true(scan_send_next(world.engine, world.bus->now));
		close_world(&world);
	}
}

static bool mishear(unsigned address, const uint8_t *request, size_t length)
{
	(void)address;
	(void)request;
	(void)length;
	return true;
}

/* A drive that has just sent may miss the beginning of the question and take the rest for a
 * request to itself. The scan waits until this drive is sure to receive. */
static void a_question_waits_until_no_drive_can_mishear_it(void **state)
{
	struct world world;
	struct node *node;
	db_time harmless;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	world.driver.mishears = mishear;
	node = world.engine->nodes[0];
	node->received_at = world.bus->now;
	node->gap.sure = 4 * MS;
	harmless = world.bus->now + 4 * MS;
	begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER });
	assert_false(scan_send_next(world.engine, world.bus->now));
	assert_int_equal(world.bus->sent_count, 0);
	assert_int_equal(scan_run_at(world.engine, world.bus->now), harmless);
	assert_false(scan_send_next(world.engine, harmless - 1));
	assert_true(scan_send_next(world.engine, harmless));
	close_world(&world);
}

/* --- received bytes --------------------------------------------------------------------------- */

/* The wait is charged to the background's share of the line, and the next question waits for the
 * turnaround time. */
static void silence_ends_a_question(void **state)
{
	struct world world;
	struct shares shares;
	db_time took = FRAME + EXTRA + LATENCY;
	db_time busy;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	busy = world.engine->busy;
	world.engine->shares.waiting = DB_SHARE_BIT(DB_SHARE_STANDING);
	shares = world.engine->shares;
	shares_charge(&shares, DB_SHARE_BACKGROUND, took);
	assert_false(is_over(&world, world.scan->question.silent_by - 1));
	assert_true(is_over(&world, world.scan->question.silent_by));
	assert_int_equal(world.engine->flights, 0);
	assert_int_equal(world.engine->busy, busy + took);
	assert_int_equal(world.engine->quiet_until, world.bus->now + TURNAROUND);
	assert_int_equal(world.scan->idle_since, world.bus->now);
	assert_memory_equal(&world.engine->shares, &shares, sizeof shares);
	/* Nothing was received, so no late answer is awaited. */
	assert_int_equal(world.scan->not_before, 0);
	close_world(&world);
}

/* On CAN other exchanges use the wire while the scan waits for its answer. */
static void on_can_the_wait_for_an_answer_is_not_busy_time(void **state)
{
	struct world world;
	db_time busy;

	(void)state;
	ask(&world, DB_MEDIUM_CAN, STRANGER);
	busy = world.engine->busy;
	world.engine->flights = 1;
	receive_inquired(&world, STRANGER + 1, DB_RECOGNISED_NOTHING);
	assert_int_equal(world.scan->question.received, 0);
	assert_true(is_over(&world, world.scan->question.silent_by));
	assert_int_equal(world.engine->busy, busy);
	assert_int_equal(world.engine->flights, 1);
	world.engine->flights = 0;
	/* On CAN bytes that are left in the buffer are no damaged answer. */
	ask_next(&world);
	world.engine->received_length = 2 * sizeof(struct fake_frame);
	assert_true(is_over(&world, world.scan->question.silent_by));
	assert_int_equal(world.scan->visit.find.garbled, 0);
	world.engine->received_length = 0;
	close_world(&world);
}

/* If anything was received from this address, its answer to this question may still arrive, and
 * would be taken for the answer to the next one. So the scan waits for it first. */
static void late_answers_are_waited_for(void **state)
{
	static const struct {
		bool known, bytes, waits;
	} cases[] = { { false, false, false }, { true, false, true }, { false, true, true } };

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct world world;

		ask(&world, DB_MEDIUM_SERIAL, STRANGER);
		world.scan->response_known = cases[i].known;
		if (cases[i].bytes)
			fake_receive(world.bus, "abc", 3);
		assert_true(is_over(&world, world.scan->question.deadline));
		assert_int_equal(world.scan->not_before,
		                 cases[i].waits ? world.bus->now + LATE_ANSWER_LATENCIES * LATENCY :
		                                  0);
		/* Fewer bytes than an answer has may be the beginning of a late one: they are no
		 * damage. */
		assert_int_equal(world.scan->visit.find.garbled, 0);
		close_world(&world);
	}
}

/* The question goes on while bytes arrive, but at most for twice its time. */
static void a_question_ends_when_no_more_bytes_arrive(void **state)
{
	struct world world;
	db_time sent;
	db_time deadline;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	world.driver.cut = cut_nothing;
	deadline = world.scan->question.deadline;
	sent = world.scan->question.sent;
	world.bus->now = deadline - QUIET / 2;
	fake_receive(world.bus, "a", 1);
	assert_false(is_over(&world, deadline - 1));
	assert_int_equal(scan_run_at(world.engine, deadline - 1), deadline);
	assert_false(is_over(&world, deadline));
	assert_int_equal(scan_run_at(world.engine, deadline), deadline + QUIET / 2);
	assert_false(is_over(&world, deadline + QUIET / 2 - 1));
	assert_true(is_over(&world, deadline + QUIET / 2));
	ask_next(&world);
	deadline = world.scan->question.deadline;
	sent = world.scan->question.sent;
	for (world.bus->now = deadline - QUIET / 2; world.bus->now < 2 * deadline - sent;
	     world.bus->now += QUIET / 2) {
		fake_receive(world.bus, "a", 1);
		assert_false(is_over(&world, world.bus->now));
	}
	world.bus->now = 2 * deadline - sent - 1;
	fake_receive(world.bus, "a", 1);
	assert_false(is_over(&world, world.bus->now));
	assert_true(is_over(&world, 2 * deadline - sent));
	close_world(&world);
}

/* The line returns the first `echoed` bytes of the question, followed by `others` bytes of
 * garbage. True if the scan counts this as damage. With `cuts` the driver skips garbage. */
static bool is_damage(size_t echoed, size_t others, bool cuts)
{
	const struct fake_frame frame = { .address = STRANGER, .kind = FAKE_INQUIRY };
	uint8_t bytes[64];
	struct world world;
	bool garbled;

	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	world.driver.cut = cuts ? cut : cut_nothing;
	memset(bytes, GARBAGE, sizeof bytes);
	/* Here the driver takes the question itself for garbage. */
	if (cuts)
		memset(world.scan->request, GARBAGE, sizeof frame);
	else
		memcpy(bytes, &frame, echoed);
	fake_receive(world.bus, bytes, 1);
	fake_receive(world.bus, bytes + 1, echoed + others - 1);
	world.bus->now = world.scan->question.deadline + QUIET;
	assert_true(is_over(&world, world.bus->now));
	garbled = world.scan->visit.find.garbled > 0;
	close_world(&world);
	return garbled;
}

static void an_echo_of_the_question_is_no_damage(void **state)
{
	const size_t length = sizeof(struct fake_frame);

	(void)state;
	assert_false(is_damage(length, 0, false));
	assert_false(is_damage(length, 0, true));
	/* Bytes after a whole echo are damage. */
	assert_true(is_damage(length, 1, true));
	assert_true(is_damage(length, length, false));
	/* Without a whole echo, as many bytes as an answer has are damage. */
	assert_true(is_damage(1, length - 1, false));
	assert_false(is_damage(1, length - 2, false));
}

/* When only the echo arrives, the question ends as early as without any bytes. */
static void an_echo_is_no_answer(void **state)
{
	struct world world;
	db_time silent_by;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	world.driver.cut = cut_nothing;
	silent_by = world.scan->question.silent_by;
	fake_receive(world.bus, world.scan->request, sizeof(struct fake_frame));
	assert_int_equal(world.scan->question.received, sizeof(struct fake_frame));
	assert_int_equal(world.scan->question.echoed, sizeof(struct fake_frame));
	assert_int_equal(scan_run_at(world.engine, world.bus->now), silent_by);
	assert_false(is_over(&world, silent_by - 1));
	assert_true(is_over(&world, silent_by));
	/* No drive was heard, so no late answer is awaited. */
	assert_int_equal(world.scan->not_before, 0);
	/* The echo is not longer than the question: the byte after it is no part of it. */
	ask_next(&world);
	fake_receive(world.bus, world.scan->request, sizeof(struct fake_frame) + 1);
	assert_int_equal(world.scan->question.received, sizeof(struct fake_frame) + 1);
	assert_int_equal(world.scan->question.echoed, sizeof(struct fake_frame));
	close_world(&world);
}

static void damaged_frames_are_damage(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	receive_inquired(&world, 0, DB_RECOGNISED_ANSWER);
	assert_int_equal(world.scan->question.garbage, sizeof(struct fake_frame));
	/* It is not counted as a damaged frame of the bus's own exchanges. */
	assert_int_equal(fake_stats(world.bus).bad_frames, 0);
	assert_true(is_over(&world, world.scan->question.deadline));
	assert_int_equal(world.scan->visit.find.garbled, 1);
	close_world(&world);
}

/* A single byte of garbage is enough. */
static void garbage_is_damage(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	world.driver.cut = cut;
	fake_receive(world.bus, &(uint8_t){ GARBAGE }, 1);
	assert_int_equal(world.scan->question.garbage, 1);
	assert_true(is_over(&world, world.scan->question.deadline));
	assert_int_equal(world.scan->visit.find.garbled, 1);
	close_world(&world);
}

static void answers_are_counted(void **state)
{
	static const struct {
		enum db_recognised what;
		bool answered, doubled;
	} cases[] = {
		{ DB_RECOGNISED_ANSWER, true, false },
		{ DB_RECOGNISED_AGAIN, false, true },
		{ DB_RECOGNISED_PART, false, false },
	};

	(void)state;
	for (enum db_medium medium = DB_MEDIUM_SERIAL; medium <= DB_MEDIUM_CAN; medium++) {
		for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
			struct world world;
			const struct question *question;

			ask(&world, medium, STRANGER);
			question = &world.scan->question;
			world.bus->now += 5 * MS;
			receive_inquired(&world, STRANGER, cases[i].what);
			assert_int_equal(question->outcome.answered, cases[i].answered);
			assert_int_equal(question->outcome.doubled, cases[i].doubled);
			assert_int_equal(question->outcome.time_us, cases[i].answered ? 5000 : 0);
			/* Counted once: by scan_receive() on a line, by scan_receive_frame() on
			 * CAN. */
			assert_int_equal(question->received, sizeof(struct fake_frame));
			assert_int_equal(question->received_at, world.bus->now);
			close_world(&world);
		}
	}
}

/* A frame that does not answer the question is left to the engine, as without a scan. */
static void frames_that_are_no_answer_are_left_to_the_engine(void **state)
{
	const struct fake_frame poll = { .address = 1, .kind = FAKE_POLL };
	const struct fake_frame foreign = { .address = STRANGER,
		                            .kind = FAKE_INQUIRY,
		                            .target = DB_RECOGNISED_ANSWER };
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_CAN, STRANGER);
	assert_false(scan_receive_frame(world.engine, DB_FRAME_GOOD, (const uint8_t *)&poll,
	                                sizeof poll, world.bus->now));
	assert_false(scan_receive_frame(world.engine, DB_FRAME_FOREIGN, (const uint8_t *)&foreign,
	                                sizeof foreign, world.bus->now));
	/* On CAN a damaged frame may be from any other node. */
	assert_false(scan_receive_frame(world.engine, DB_FRAME_BAD, (const uint8_t *)&foreign,
	                                sizeof foreign, world.bus->now));
	assert_int_equal(world.scan->question.garbage, 0);
	assert_false(world.scan->question.outcome.answered);
	assert_true(scan_receive_frame(world.engine, DB_FRAME_GOOD, (const uint8_t *)&foreign,
	                               sizeof foreign, world.bus->now));
	assert_true(is_over(&world, world.scan->question.deadline + QUIET));
	/* The question has ended. */
	assert_false(scan_receive_frame(world.engine, DB_FRAME_GOOD, (const uint8_t *)&foreign,
	                                sizeof foreign, world.bus->now));
	close_world(&world);
}

/* Bytes that arrive after the question has ended, or after the scan, are not counted. */
static void bytes_without_a_question_are_not_counted(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	assert_true(is_over(&world, world.scan->question.silent_by));
	fake_receive(world.bus, "abc", 3);
	assert_int_equal(world.scan->question.received, 0);
	world.driver.cut = cut;
	fake_receive(world.bus, &(uint8_t){ GARBAGE }, 1);
	assert_int_equal(world.scan->question.garbage, 0);
	scan_end(world.engine, DB_SCAN_CANCELLED);
	scan_receive(world.engine, (const uint8_t *)"abc", 3, world.bus->now);
	assert_int_equal(world.scan->question.received, 0);
	close_world(&world);
}

/* The question that cut() was given last. On CAN there is none, because several drives may be
 * asked at once. */
static const uint8_t *cut_with;

static void cut_can(const struct db_received *received, size_t *skip, size_t *length)
{
	cut_with = received->question;
	db_can_cut(received->bytes, received->available, skip, length);
}

static void frames_are_cut_with_the_scans_question_on_a_line_only(void **state)
{
	(void)state;
	for (enum db_medium medium = DB_MEDIUM_SERIAL; medium <= DB_MEDIUM_CAN; medium++) {
		struct world world;

		ask(&world, medium, STRANGER);
		world.driver.cut = cut_can;
		cut_with = (const uint8_t *)"";
		fake_receive(world.bus, "abc", 3);
		if (medium == DB_MEDIUM_CAN)
			assert_null(cut_with);
		else
			assert_ptr_equal(cut_with, world.scan->request);
		close_world(&world);
	}
}

/* --- configured drives ------------------------------------------------------------------------ */

/* The drive's late answer to the scan could be taken for the answer to its next request, so the
 * drive must be probed first. */
static void a_drive_that_did_not_answer_is_out_of_step(void **state)
{
	(void)state;
	for (unsigned answers = 0; answers < 2; answers++) {
		struct world world;
		struct node *node;

		ask(&world, DB_MEDIUM_SERIAL, 1);
		node = world.engine->nodes[0];
		node->risky_until = 0;
		if (answers)
			receive_inquired(&world, 1, DB_RECOGNISED_ANSWER);
		assert_true(is_over(&world, world.scan->question.deadline));
		assert_int_equal(node->in_step, answers);
		assert_int_equal(node->risky_until,
		                 answers ? 0 : world.bus->now + node->late_answer_time);
		assert_true(world.engine->nodes[1]->in_step);
		close_world(&world);
	}
}

static void a_question_gives_way_to_requests_to_its_drive(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, 2);
	assert_false(scan_is_asking(world.engine, world.engine->nodes[0]));
	assert_true(scan_is_asking(world.engine, world.engine->nodes[1]));
	/* While the bus is out of service, the address does not stand for a configured drive. */
	world.scan->plan.aside = true;
	assert_false(scan_is_asking(world.engine, world.engine->nodes[1]));
	world.scan->plan.aside = false;
	world.scan->visit.standings = 2;
	world.scan->visit.standing_tries = 2;
	/* A request to another drive does not end the question; one to its own drive does. After
	 * a command the scan also asks again whether the drive stands. */
	scan_give_way(world.engine, world.engine->nodes[0], true);
	assert_true(world.scan->question.flying);
	assert_int_equal(world.scan->visit.standings, 2);
	scan_give_way(world.engine, world.engine->nodes[1], false);
	assert_false(world.scan->question.flying);
	assert_int_equal(world.engine->flights, 0);
	assert_int_equal(world.scan->visit.standings, 2);
	scan_give_way(world.engine, world.engine->nodes[1], true);
	assert_int_equal(world.scan->visit.standings, 0);
	assert_int_equal(world.scan->visit.standing_tries, 0);
	close_world(&world);
}

/* --- the end of a scan ------------------------------------------------------------------------ */

static void the_end_of_a_scan_ends_its_question(void **state)
{
	/* On a line the question is an exchange under way, unless the lost port has ended it
	 * already. On CAN the one exchange is another drive's. */
	static const struct {
		enum db_medium medium;
		unsigned flights, left;
	} cases[] = {
		{ DB_MEDIUM_SERIAL, 1, 0 },
		{ DB_MEDIUM_SERIAL, 0, 0 },
		{ DB_MEDIUM_CAN, 1, 1 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct world world;

		ask(&world, cases[i].medium, STRANGER);
		world.engine->flights = cases[i].flights;
		world.engine->idle_until = DB_TIME_NEVER;
		scan_end(world.engine, DB_SCAN_CANCELLED);
		assert_int_equal(world.engine->flights, cases[i].left);
		assert_int_equal(world.engine->idle_until, 0);
		assert_null(world.engine->scan);
		world.engine->flights = 0;
		close_world(&world);
	}
}

static void the_end_of_a_scan_leaves_other_exchanges(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER });
	world.engine->flights = 1;
	scan_end(world.engine, DB_SCAN_CANCELLED);
	assert_int_equal(world.engine->flights, 1);
	world.engine->flights = 0;
	close_world(&world);
}

/* The scan ends at the engine's next call, although its next question is not due yet. */
static void a_scan_that_is_cancelled_ends_at_once(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER });
	world.scan->not_before = world.bus->now + 1000 * MS;
	(void)db_engine_run(world.engine, world.bus->now);
	atomic_store(&world.scan->cancelled, true);
	(void)db_engine_run(world.engine, world.bus->now + 1);
	assert_true(atomic_load(&world.scan->ended));
	close_world(&world);
}

static void a_scan_gives_up_when_there_is_no_time_for_it(void **state)
{
	(void)state;
	for (unsigned room = 0; room < 2; room++) {
		struct world world;

		open_world(&world, DB_MEDIUM_SERIAL);
		begin_plan(&world, (struct db_scan_plan){ .first = STRANGER, .last = STRANGER });
		world.engine->stats.period_us = 20000;
		world.engine->stats.cycle_us = room ? 19999 : 20001;
		world.scan->idle_since = world.bus->now - 3 * DB_NS_PER_S;
		scan_check(world.engine, world.bus->now);
		assert_false(atomic_load(&world.scan->ended));
		scan_check(world.engine, world.bus->now + 1);
		assert_true(atomic_load(&world.scan->ended));
		assert_int_equal(progress_of(&world).end, DB_SCAN_NO_ROOM);
		assert_int_equal(progress_of(&world).gap_us, room);
		close_world(&world);
	}
}

static void an_address_counts_even_if_its_find_has_no_room(void **state)
{
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_SERIAL, STRANGER);
	for (world.scan->progress.finds = DB_SCAN_FINDS_MAX - 1;;) {
		receive_inquired(&world, world.scan->question.inquiry.address,
		                 DB_RECOGNISED_ANSWER);
		assert_true(is_over(&world, world.scan->question.deadline));
		world.bus->now = db_time_max(world.bus->now, world.engine->quiet_until);
		world.scan->not_before = 0;
		if (!scan_send_next(world.engine, world.bus->now))
			break;
	}
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	assert_int_equal(progress_of(&world).asked, 2);
	assert_int_equal(progress_of(&world).finds, DB_SCAN_FINDS_MAX);
	assert_int_equal(world.scan->finds[DB_SCAN_FINDS_MAX - 1].address, STRANGER);
	close_world(&world);
}

/* --- a bus that is out of service ------------------------------------------------------------- */

static const struct db_scan_plan aside = {
	.first = 1, .last = 4, .aside = true, .speed_count = 3, .speeds = { 9600, 19200, 38400 }
};

/* The port is opened at each speed of the plan, and there all addresses are asked, from the
 * first on. */
static void a_line_is_opened_at_each_speed(void **state)
{
	struct world world;
	const struct db_bus_config *port;
	db_time now;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	begin_plan(&world, aside);
	assert_int_equal(progress_of(&world).speed, 115200);
	assert_false(atomic_load(&world.scan->ended));
	db_engine_set_aside(world.engine, world.bus->now);
	now = world.bus->now;
	port = scan_port_config(world.engine);
	assert_int_equal(port->baud, 9600);
	/* The port is not open yet. */
	assert_false(scan_send_next(world.engine, now));
	assert_int_equal(scan_run_at(world.engine, now), now + 2 * MS);
	world.engine->received_length = 5;
	scan_port(world.engine, true, 0, now);
	assert_int_equal(world.engine->received_length, 0);
	assert_int_equal(world.engine->quiet_until, now + TURNAROUND);
	assert_int_equal(scan_run_at(world.engine, now), now + TURNAROUND);
	assert_false(scan_send_next(world.engine, now));
	now += TURNAROUND;
	assert_int_equal(scan_run_at(world.engine, now), now + 1);
	assert_true(scan_send_next(world.engine, now));
	assert_int_equal(world.scan->question.silent_by, now + FRAME + EXTRA + LATENCY);
	/* The port does not support this speed: its other addresses count as asked. */
	world.scan->progress.asked = 3;
	scan_port(world.engine, false, EINVAL, now);
	assert_false(world.scan->question.flying);
	assert_int_equal(world.engine->flights, 0);
	assert_false(world.scan->visiting);
	assert_false(world.scan->port_up);
	assert_int_equal(world.scan->progress.asked, 4);
	assert_int_equal(progress_of(&world).asked, 4);
	assert_int_equal(progress_of(&world).error, EINVAL);
	assert_int_equal(scan_port_config(world.engine)->baud, 19200);
	scan_port(world.engine, true, 0, now);
	now += TURNAROUND;
	assert_true(scan_send_next(world.engine, now));
	assert_int_equal(world.scan->question.inquiry.address, 1);
	scan_port(world.engine, false, EINVAL, now);
	scan_port(world.engine, false, EINVAL, now);
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	assert_int_equal(progress_of(&world).asked, 12);
	close_world(&world);
}

static void on_can_a_scan_changes_the_bit_rate(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DB_MEDIUM_CAN);
	begin_plan(&world, aside);
	assert_int_equal(progress_of(&world).speed, 500000);
	assert_int_equal(scan_port_config(world.engine)->bitrate, 9600);
	assert_int_equal(scan_port_config(world.engine)->baud, 115200);
	close_world(&world);
}

static void no_bus_is_set_aside_while_one_of_its_drives_moves(void **state)
{
	(void)state;
	for (size_t moving = 0; moving < 2; moving++) {
		struct world world;

		open_world(&world, DB_MEDIUM_SERIAL);
		world.engine->stations[moving]->snapshot.feedback.status |= DB_STATUS_MOVING;
		begin_plan(&world, aside);
		assert_int_equal(progress_of(&world).end, DB_SCAN_MOVES);
		assert_int_equal(progress_of(&world).drive, moving);
		close_world(&world);
	}
}

/* --- frames of other senders on CAN ----------------------------------------------------------- */

static void receive_from(struct world *world, uint32_t id, size_t length)
{
	struct db_can_frame frame = { .id = id };

	scan_count_foreign(world->engine, (const uint8_t *)&frame, length);
}

static void frames_of_others_are_counted_by_their_ids(void **state)
{
	const struct fake_frame stranger = { .address = 9, .kind = FAKE_POLL };
	const struct fake_frame foreign = { .address = 1, .kind = FAKE_FOREIGN };
	struct world world;

	(void)state;
	ask(&world, DB_MEDIUM_CAN, STRANGER);
	for (uint32_t i = 0; i < DB_SCAN_FOREIGN_MAX - 2; i++) {
		for (uint32_t k = 0; k <= i % 3; k++)
			receive_from(&world, 100 + i, sizeof(struct db_can_frame));
	}
	assert_int_equal(world.scan->progress.foreign, DB_SCAN_FOREIGN_MAX - 2);
	for (uint32_t i = 0; i < DB_SCAN_FOREIGN_MAX - 2; i++) {
		assert_int_equal(world.scan->foreign[i].id, 100 + i);
		assert_int_equal(world.scan->foreign[i].count, 1 + i % 3);
	}
	fake_receive(world.bus, &stranger, sizeof stranger);
	assert_int_equal(world.scan->progress.foreign, DB_SCAN_FOREIGN_MAX - 1);
	fake_receive(world.bus, &foreign, sizeof foreign);
	assert_int_equal(world.scan->progress.foreign, DB_SCAN_FOREIGN_MAX);
	receive_from(&world, 5000, sizeof(struct db_can_frame));
	receive_from(&world, 100, sizeof(struct db_can_frame));
	receive_from(&world, 100, sizeof(struct db_can_frame) - 1);
	assert_int_equal(world.scan->progress.foreign, DB_SCAN_FOREIGN_MAX);
	assert_int_equal(world.scan->foreign[0].count, 2);
	scan_end(world.engine, DB_SCAN_CANCELLED);
	receive_from(&world, 100, sizeof(struct db_can_frame));
	assert_int_equal(world.scan->foreign[0].count, 2);
	close_world(&world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_question_takes_its_time_on_the_wire),
		cmocka_unit_test(a_question_on_can_waits_for_the_wire),
		cmocka_unit_test(a_question_ends_before_the_next_cycle),
		cmocka_unit_test(each_address_gets_the_same_wait),
		cmocka_unit_test(a_drive_that_has_answered_needs_less_time),
		cmocka_unit_test(at_the_next_address_the_response_time_is_unknown_again),
		cmocka_unit_test(a_setting_may_take_longer_than_a_cycle),
		cmocka_unit_test(nothing_is_saved_before_each_drive_was_read),
		cmocka_unit_test(a_question_is_asked_as_soon_as_it_may_be),
		cmocka_unit_test(a_question_waits_until_no_drive_can_mishear_it),
		cmocka_unit_test(silence_ends_a_question),
		cmocka_unit_test(on_can_the_wait_for_an_answer_is_not_busy_time),
		cmocka_unit_test(late_answers_are_waited_for),
		cmocka_unit_test(a_question_ends_when_no_more_bytes_arrive),
		cmocka_unit_test(an_echo_of_the_question_is_no_damage),
		cmocka_unit_test(an_echo_is_no_answer),
		cmocka_unit_test(damaged_frames_are_damage),
		cmocka_unit_test(garbage_is_damage),
		cmocka_unit_test(answers_are_counted),
		cmocka_unit_test(frames_that_are_no_answer_are_left_to_the_engine),
		cmocka_unit_test(bytes_without_a_question_are_not_counted),
		cmocka_unit_test(frames_are_cut_with_the_scans_question_on_a_line_only),
		cmocka_unit_test(a_drive_that_did_not_answer_is_out_of_step),
		cmocka_unit_test(a_question_gives_way_to_requests_to_its_drive),
		cmocka_unit_test(the_end_of_a_scan_ends_its_question),
		cmocka_unit_test(the_end_of_a_scan_leaves_other_exchanges),
		cmocka_unit_test(a_scan_that_is_cancelled_ends_at_once),
		cmocka_unit_test(a_scan_gives_up_when_there_is_no_time_for_it),
		cmocka_unit_test(an_address_counts_even_if_its_find_has_no_room),
		cmocka_unit_test(a_line_is_opened_at_each_speed),
		cmocka_unit_test(on_can_a_scan_changes_the_bit_rate),
		cmocka_unit_test(no_bus_is_set_aside_while_one_of_its_drives_moves),
		cmocka_unit_test(frames_of_others_are_counted_by_their_ids),
	};

	return cmocka_run_group_tests_name("sched/scan_asked", tests, NULL, NULL);
}
