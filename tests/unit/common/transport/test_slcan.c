/* SPDX-License-Identifier: Apache-2.0 */
/* The adapter is the test itself, at the other end of a pty; time is what the test says it is. */
#include "codec/can.h"
#include "drivebridge/transport.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmocka.h>

#define EXT DB_CAN_EXTENDED
#define MS DB_NS_PER_MS
#define WAIT 5000 /* ms; for what comes at once */

static const struct db_transport *const slcan = &db_transport_slcan;

struct bench {
	int master;
	char path[64];
	struct db_bus_config bus;
	struct db_port *port;
	const struct db_port_health *health;
	db_time now;
};

/* --- the adapter's side ----------------------------------------------------------------------------- */

/* Reads as many characters as `wanted` has, and they must be these. */
static void expect(const struct bench *bench, const char *wanted)
{
	char got[256] = { 0 };
	size_t length = 0;

	while (length < strlen(wanted)) {
		struct pollfd one = { .fd = bench->master, .events = POLLIN };
		ssize_t count;

		assert_int_equal(poll(&one, 1, WAIT), 1);
		count = read(bench->master, got + length, strlen(wanted) - length);
		assert_true(count > 0);
		length += (size_t)count;
	}
	assert_string_equal(got, wanted);
}

/* Writes and waits until all of it can be read at the other end. */
static void tell(const struct bench *bench, const char *text)
{
	int waiting = 0;

	assert_int_equal(write(bench->master, text, strlen(text)), strlen(text));
	while (waiting < (int)strlen(text)) {
		struct pollfd one = { .fd = slcan->fd(bench->port), .events = POLLIN };

		assert_int_equal(poll(&one, 1, WAIT), 1);
		assert_int_equal(ioctl(one.fd, FIONREAD, &waiting), 0);
	}
}

/* Tells something that holds no frame for the bus. */
static void answer(struct bench *bench, const char *text)
{
	struct db_can_frame frames[8];

	tell(bench, text);
	assert_int_equal(slcan->read(bench->port, frames, sizeof frames, bench->now), 0);
}

/* --- the host's side -------------------------------------------------------------------------------- */

/* Lets the port do what is due at this time. */
static db_time run_at(struct bench *bench, db_time now)
{
	int error = 0;
	db_time next;

	bench->now = now;
	next = slcan->run(bench->port, now, &error);
	assert_int_equal(error, 0);
	return next;
}

static void send_id(struct bench *bench, uint32_t id)
{
	const struct db_can_frame frame = { .id = id };

	assert_int_equal(slcan->write(bench->port, &frame, sizeof frame, bench->now), sizeof frame);
}

static void set_up_filtered(struct bench *bench, const struct db_can_filter *filters, size_t count)
{
	memset(bench, 0, sizeof *bench);
	bench->master = posix_openpt(O_RDWR | O_NOCTTY);
	assert_true(bench->master >= 0);
	assert_int_equal(grantpt(bench->master), 0);
	assert_int_equal(unlockpt(bench->master), 0);
	assert_int_equal(ptsname_r(bench->master, bench->path, sizeof bench->path), 0);
	bench->bus = (struct db_bus_config){
		.device = bench->path, .baud = 115200, .stop_bits = 1, .bitrate = 500000
	};
	assert_int_equal(slcan->open(&bench->bus, filters, count, 0, &bench->port), 0);
	bench->health = slcan->health(bench->port);
	expect(bench, "\r\r\r");
}

static void set_up(struct bench *bench)
{
	set_up_filtered(bench, NULL, 0);
}

/* From what was just flushed to an open channel. */
static void shake_hands(struct bench *bench, bool with_timestamps)
{
	run_at(bench, run_at(bench, bench->now));
	expect(bench, "C\r");
	answer(bench, "\r");
	expect(bench, "S6\r");
	answer(bench, "\r");
	if (with_timestamps) {
		expect(bench, "Z0\r");
		answer(bench, "\r");
	}
	expect(bench, "O\r");
	assert_false(bench->health->up);
	answer(bench, "\r");
	assert_true(bench->health->up);
}

static void set_up_ready(struct bench *bench)
{
	set_up(bench);
	shake_hands(bench, true);
}

static void tear_down(struct bench *bench)
{
	slcan->close(bench->port);
	close(bench->master);
}

/* --- opening ---------------------------------------------------------------------------------------- */

static void what_cannot_be_opened_says_why(void **state)
{
	struct db_bus_config bus = { .device = (char *)"/dev/drivebridge-no-such-port",
		                     .baud = 115200,
		                     .stop_bits = 1,
		                     .bitrate = 500000 };
	struct db_port *port = NULL;

	(void)state;
	assert_int_equal(slcan->open(&bus, NULL, 0, 0, &port), -ENOENT);
	bus.bitrate = 333333;
	assert_int_equal(slcan->open(&bus, NULL, 0, 0, &port), -EINVAL);
	assert_null(port);
	slcan->close(NULL);
}

static void the_channel_is_up_once_the_adapter_opened_it(void **state)
{
	struct bench bench;

	(void)state;
	set_up(&bench);
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, EINPROGRESS);
	assert_int_equal(bench.health->bitrate, 0);
	assert_int_equal(run_at(&bench, 49 * MS), 50 * MS);
	shake_hands(&bench, true);
	assert_int_equal(bench.health->error, 0);
	assert_int_equal(bench.health->bitrate, 500000);
	assert_int_equal(bench.health->refused, 0);
	tear_down(&bench);
}

/* A channel that was closed already, an adapter without time stamps. */
static void refusals_that_do_not_matter(void **state)
{
	struct bench bench;

	(void)state;
	set_up(&bench);
	run_at(&bench, 50 * MS);
	expect(&bench, "C\r");
	answer(&bench, "\a");
	expect(&bench, "S6\r");
	answer(&bench, "\r");
	expect(&bench, "Z0\r");
	answer(&bench, "\a");
	expect(&bench, "O\r");
	answer(&bench, "\r");
	assert_true(bench.health->up);
	assert_int_equal(bench.health->refused, 0);
	tear_down(&bench);
}

static void silence_about_time_stamps_does_not_matter(void **state)
{
	struct bench bench;

	(void)state;
	set_up(&bench);
	run_at(&bench, 50 * MS);
	expect(&bench, "C\r");
	answer(&bench, "\r");
	expect(&bench, "S6\r");
	answer(&bench, "\r");
	expect(&bench, "Z0\r");
	assert_int_equal(run_at(&bench, 349 * MS), 350 * MS);
	run_at(&bench, 350 * MS);
	expect(&bench, "O\r");
	answer(&bench, "\r");
	assert_true(bench.health->up);
	tear_down(&bench);
}

/* Late answers to what was before must not pass for answers to the handshake. */
static void flushing_waits_for_silence(void **state)
{
	struct bench bench;

	(void)state;
	set_up(&bench);
	run_at(&bench, 40 * MS);
	answer(&bench, "\r\a\r");
	assert_int_equal(run_at(&bench, 50 * MS), 90 * MS);
	run_at(&bench, 80 * MS);
	answer(&bench, "\a");
	assert_int_equal(run_at(&bench, 90 * MS), 130 * MS);
	/* Frames of a channel that is still open are no answers; nor are they handed over. */
	answer(&bench, "t1230\rz\r");
	run_at(&bench, 130 * MS);
	expect(&bench, "C\r");
	tear_down(&bench);
}

static void flushing_ends_even_without_silence(void **state)
{
	struct bench bench;
	db_time now = 0;

	(void)state;
	set_up(&bench);
	for (; now < 350 * MS; now += 10 * MS) {
		run_at(&bench, now);
		answer(&bench, "\r");
	}
	run_at(&bench, 350 * MS);
	expect(&bench, "C\r");
	tear_down(&bench);
}

/* One handshake in vain after the other; the port is given up in the end. */
static void a_bit_rate_that_is_refused_gives_up(void **state)
{
	struct bench bench;
	int error = 0;

	(void)state;
	set_up(&bench);
	for (unsigned i = 0; i < 10; i++) {
		struct db_can_frame got;

		if (i > 0)
			expect(&bench, "\r\r\r");
		run_at(&bench, run_at(&bench, bench.now));
		expect(&bench, "C\r");
		answer(&bench, "\r");
		expect(&bench, "S6\r");
		tell(&bench, "\a");
		assert_int_equal(slcan->read(bench.port, &got, sizeof got, bench.now),
		                 i < 9 ? 0 : -EINVAL);
		assert_int_equal(bench.health->error, EINVAL);
	}
	slcan->run(bench.port, bench.now, &error);
	assert_int_equal(error, -EINVAL);
	assert_int_equal(bench.health->refused, 10);
	tear_down(&bench);
}

static void an_adapter_that_never_answers_is_given_up(void **state)
{
	struct bench bench;
	unsigned runs = 0;
	int error = 0;

	(void)state;
	set_up(&bench);
	while (error == 0 && runs++ < 100)
		bench.now = slcan->run(bench.port, bench.now, &error);
	assert_int_equal(error, -ETIMEDOUT);
	/* ten times 50 ms of flushing and 300 ms of waiting */
	assert_in_range(bench.now / MS, 3500, 3900);
	assert_false(bench.health->up);
	tear_down(&bench);
}

static void a_channel_that_does_not_open_is_tried_again(void **state)
{
	struct bench bench;

	(void)state;
	set_up(&bench);
	run_at(&bench, 50 * MS);
	expect(&bench, "C\r");
	answer(&bench, "\r");
	expect(&bench, "S6\r");
	answer(&bench, "\r");
	expect(&bench, "Z0\r");
	answer(&bench, "\r");
	expect(&bench, "O\r");
	answer(&bench, "\a");
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, EPROTO);
	expect(&bench, "\r\r\r");
	/* Time stamps were settled: that may cost a write to an EEPROM each time. */
	shake_hands(&bench, false);
	tear_down(&bench);
}

/* --- frames ----------------------------------------------------------------------------------------- */

static void frames_pass_both_ways(void **state)
{
	static const struct db_can_frame frames[] = {
		{ .id = EXT | 0x0C0101, .length = 2, .data = { 0x12, 0xAB } },
		{ .id = DB_CAN_REMOTE | 0x7FF },
	};
	struct db_can_frame got[8];
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	assert_int_equal(slcan->write(bench.port, frames, sizeof frames, 0), sizeof frames);
	expect(&bench, "T000C0101212AB\rr7FF0\r");
	tell(&bench, "Z\rz\rT000C010221234\rt10081122334455667788ABCD\rt10");
	memset(got, 0xAA, sizeof got);
	assert_int_equal(slcan->read(bench.port, got, sizeof got, 0), 32);
	assert_int_equal(got[0].id, EXT | 0x0C0102);
	assert_int_equal(got[0].length, 2);
	assert_memory_equal(got[0].data, "\x12\x34", 2);
	assert_memory_equal(got[0].reserved, "\0\0\0", 3);
	assert_int_equal(got[1].id, 0x100);
	assert_memory_equal(got[1].data, "\x11\x22\x33\x44\x55\x66\x77\x88", 8);
	/* The rest of the line that was half there. */
	tell(&bench, "00\r");
	assert_int_equal(slcan->read(bench.port, got, sizeof got, 0), 16);
	assert_int_equal(got[0].id, 0x100);
	assert_int_equal(got[0].length, 0);
	assert_int_equal(bench.health->line_errors, 0);
	tear_down(&bench);
}

static void nothing_is_lost_when_there_is_little_room(void **state)
{
	struct db_can_frame got[3];
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	for (size_t room = 1; room <= 3; room++) {
		unsigned id = 0x100;

		tell(&bench, "t1000\rt1010\rt1020\rt1030\rt1040\rt1050\rt1060\r");
		for (unsigned i = 0; i < 100 && id < 0x107; i++) {
			ssize_t count = slcan->read(bench.port, got, room * sizeof got[0], 0);

			assert_in_range(count, 0, room * sizeof got[0]);
			for (ssize_t k = 0; k < count / 16; k++)
				assert_int_equal(got[k].id, id++);
		}
		assert_int_equal(id, 0x107);
	}
	assert_int_equal(slcan->read(bench.port, got, 15, 0), 0);
	tear_down(&bench);
}

static void frames_that_no_filter_passes_are_dropped(void **state)
{
	struct db_can_filter filters[] = {
		{ .id = 0x120, .mask = EXT | 0x7F0 },
		{ .id = EXT | 0x00FF0000, .mask = EXT | 0x00FF0000 },
	};
	struct db_can_frame got[8];
	struct bench bench;

	(void)state;
	set_up_filtered(&bench, filters, 2);
	memset(filters, 0, sizeof filters); /* the port has its own copy */
	shake_hands(&bench, true);
	tell(&bench, "t1300\rt12A0\rT000001200\rT00FF12340\r");
	assert_int_equal(slcan->read(bench.port, got, sizeof got, 0), 32);
	assert_int_equal(got[0].id, 0x12A);
	assert_int_equal(got[1].id, EXT | 0xFF1234);
	tear_down(&bench);
}

static void nothing_is_taken_before_the_channel_is_open(void **state)
{
	static const struct db_can_frame frame = { .id = 0x123 };
	struct bench bench;

	(void)state;
	set_up(&bench);
	assert_int_equal(slcan->write(bench.port, &frame, sizeof frame, 0), 0);
	shake_hands(&bench, true);
	assert_int_equal(slcan->write(bench.port, &frame, sizeof frame, 0), 16);
	expect(&bench, "t1230\r");
	tear_down(&bench);
}

/* Nobody reads at the other end: what is taken comes out once and in order. */
static void a_full_line_takes_a_part_and_the_rest_once(void **state)
{
	struct db_can_frame frames[2000];
	const size_t count = sizeof frames / sizeof frames[0];
	struct bench bench;
	size_t taken;
	size_t came = 0;
	db_time next;

	(void)state;
	for (size_t i = 0; i < count; i++)
		frames[i] = (struct db_can_frame){ .id = EXT | (uint32_t)i, .length = 8 };
	set_up_ready(&bench);
	taken = (size_t)slcan->write(bench.port, frames, sizeof frames, 0) / 16;
	assert_in_range(taken, 1, count - 1);
	assert_int_equal(slcan->write(bench.port, frames + taken, 16, 0), 0);
	next = run_at(&bench, bench.now);
	assert_int_equal(next, bench.now + MS);
	while (came < count) {
		char line[32];

		if (taken < count)
			taken += (size_t)slcan->write(bench.port, frames + taken,
			                              (count - taken) * 16, 0) /
			         16;
		run_at(&bench, bench.now);
		snprintf(line, sizeof line, "T%08zX80000000000000000\r", came++);
		expect(&bench, line);
	}
	assert_int_equal(taken, count);
	send_id(&bench, 0x123);
	expect(&bench, "t1230\r");
	tear_down(&bench);
}

static void garbage_is_counted(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	answer(&bench, "t9990\rt1\x80\rX\rV1013\rN1234\r");
	assert_int_equal(bench.health->line_errors, 3);
	assert_true(bench.health->up);
	tear_down(&bench);
}

static void a_pulled_plug_ends_the_port(void **state)
{
	struct bench bench;
	struct pollfd one = { .events = POLLIN };
	struct db_can_frame frame = { .id = 0x123 };
	int error = 0;

	(void)state;
	set_up_ready(&bench);
	close(bench.master);
	one.fd = slcan->fd(bench.port);
	assert_int_equal(poll(&one, 1, WAIT), 1);
	assert_true(one.revents & POLLHUP);
	assert_true(slcan->read(bench.port, &frame, sizeof frame, 0) <= 0);
	slcan->write(bench.port, &frame, sizeof frame, 0);
	assert_int_equal(slcan->write(bench.port, &frame, sizeof frame, 0), -EIO);
	slcan->run(bench.port, 0, &error);
	assert_int_equal(error, -EIO);
	slcan->close(bench.port);
}

/* --- status ----------------------------------------------------------------------------------------- */

static void the_adapter_is_asked_for_its_flags(void **state)
{
	struct bench bench;
	db_time start;

	(void)state;
	set_up_ready(&bench);
	start = bench.now;
	assert_int_equal(run_at(&bench, start), start + 1000 * MS);
	run_at(&bench, start + 1000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "FE4\r"); /* bus error, arbitration lost, passive, warning */
	assert_int_equal(bench.health->line_errors, 1);
	assert_int_equal(bench.health->arbitration_lost, 1);
	assert_true(bench.health->error_passive);
	assert_true(bench.health->error_warning);
	assert_int_equal(bench.health->error_passives, 1);
	assert_true(bench.health->up);
	assert_int_equal(run_at(&bench, bench.now), start + 2000 * MS);
	run_at(&bench, start + 2000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "F29\r"); /* passive still, overrun and receive buffer full */
	assert_int_equal(bench.health->error_passives, 1);
	assert_int_equal(bench.health->overflows, 1);
	run_at(&bench, start + 3000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "F00\r");
	assert_false(bench.health->error_passive);
	assert_false(bench.health->error_warning);
	tear_down(&bench);
}

static void an_adapter_without_flags_is_asked_once(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "\a");
	assert_true(bench.health->up);
	assert_int_equal(bench.health->refused, 0);
	assert_int_equal(run_at(&bench, bench.now + 5000 * MS), DB_TIME_NEVER);
	send_id(&bench, 0x123);
	expect(&bench, "t1230\r");
	tear_down(&bench);
}

static void an_adapter_silent_about_flags_is_asked_three_times(void **state)
{
	struct bench bench;
	db_time next;

	(void)state;
	set_up_ready(&bench);
	next = bench.now + 1000 * MS;
	for (unsigned i = 0; i < 3; i++) {
		run_at(&bench, next);
		expect(&bench, "F\r");
		assert_int_equal(run_at(&bench, next), next + 300 * MS);
		next = run_at(&bench, next + 300 * MS);
	}
	assert_int_equal(next, DB_TIME_NEVER);
	assert_true(bench.health->up);
	tear_down(&bench);
}

/* It did answer before: it hangs, or was replaced by one that nobody opened. */
static void an_adapter_that_falls_silent_is_opened_again(void **state)
{
	struct bench bench;
	db_time next;

	(void)state;
	set_up_ready(&bench);
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "F00\r");
	next = bench.now + 1000 * MS;
	for (unsigned i = 0; i < 3; i++) {
		assert_true(bench.health->up);
		run_at(&bench, next);
		expect(&bench, "F\r");
		next = run_at(&bench, next + 300 * MS);
	}
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, ETIMEDOUT);
	expect(&bench, "\r\r\rC\r");
	assert_int_equal(next, bench.now + 500 * MS);
	shake_hands(&bench, false);
	tear_down(&bench);
}

/* An adapter that lost its power knows nothing of an open channel. */
static void a_channel_that_was_closed_is_opened_again(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "F00\r");
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "F\r");
	answer(&bench, "\a");
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, EPROTO);
	expect(&bench, "\r\r\rC\r");
	shake_hands(&bench, false);
	tear_down(&bench);
}

/* Answers come in order, so a refusal is the frame's that was sent before the question. */
static void a_refusal_is_told_from_that_of_a_frame(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	send_id(&bench, 1);
	expect(&bench, "t0010\r");
	answer(&bench, "z\r");
	send_id(&bench, 2);
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "t0020\rF\r");
	answer(&bench, "\aF00\r");
	assert_true(bench.health->up);
	assert_int_equal(bench.health->refused, 1);
	tear_down(&bench);
}

/* What was given up with one answer is not given up once more. */
static void flags_that_nobody_asked_for_change_no_count(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	send_id(&bench, 1);
	expect(&bench, "t0010\r");
	answer(&bench, "z\r");
	send_id(&bench, 2);
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "t0020\rF\r");
	answer(&bench, "F00\r");
	answer(&bench, "F00\r");
	run_at(&bench, bench.now + 1000 * MS);
	expect(&bench, "F\r");
	/* No frame is without an answer: it is the question that is refused. */
	answer(&bench, "\a");
	assert_int_equal(bench.health->refused, 0);
	assert_false(bench.health->up);
	tear_down(&bench);
}

/* --- frames refused one after the other ------------------------------------------------------------- */

/* Up to the question what is the matter. */
static void refuse_three(struct bench *bench)
{
	send_id(bench, 0x123);
	send_id(bench, 0x123);
	send_id(bench, 0x123);
	expect(bench, "t1230\rt1230\rt1230\r");
	answer(bench, "\a\a\a");
	assert_int_equal(bench->health->refused, 3);
	assert_true(bench->health->up);
	run_at(bench, bench->now);
	expect(bench, "F\r");
}

static void bus_off_closes_and_opens_again(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	refuse_three(&bench);
	answer(&bench, "FA4\r");
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, ENETRESET);
	assert_int_equal(bench.health->bus_offs, 1);
	expect(&bench, "\r\r\rC\r");
	answer(&bench, "\r\r\r\r");
	assert_int_equal(run_at(&bench, bench.now), bench.now + 500 * MS);
	shake_hands(&bench, false);
	assert_false(bench.health->error_passive);
	assert_int_equal(bench.health->bus_offs, 1);
	tear_down(&bench);
}

static void a_full_adapter_is_only_busy(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	refuse_three(&bench);
	answer(&bench, "F02\r");
	assert_true(bench.health->up);
	send_id(&bench, 0x124);
	expect(&bench, "t1240\r");
	tear_down(&bench);
}

/* Full and passive: nobody acknowledges. What waits inside must not be sent minutes later. */
static void a_full_adapter_that_nobody_acknowledges_is_emptied(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	refuse_three(&bench);
	answer(&bench, "FA6\r");
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, ENOBUFS);
	assert_int_equal(bench.health->bus_offs, 0);
	expect(&bench, "\r\r\rC\r");
	tear_down(&bench);
}

/* Refuses frames and the question too: the channel is closed. */
static void refusals_of_everything_open_again(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	refuse_three(&bench);
	answer(&bench, "\a");
	assert_false(bench.health->up);
	assert_int_equal(bench.health->error, EPROTO);
	expect(&bench, "\r\r\rC\r");
	tear_down(&bench);
}

static void single_refusals_are_counted_only(void **state)
{
	struct bench bench;

	(void)state;
	set_up_ready(&bench);
	for (unsigned i = 0; i < 6; i++) {
		send_id(&bench, 0x123);
		expect(&bench, "t1230\r");
		answer(&bench, i % 3 == 2 ? "z\r" : "\a");
	}
	assert_int_equal(bench.health->refused, 4);
	assert_true(run_at(&bench, bench.now) > bench.now);
	assert_true(bench.health->up);
	tear_down(&bench);
}

/* --- the wire --------------------------------------------------------------------------------------- */

static void wire_time_is_that_of_the_slowest_part(void **state)
{
	static const struct db_can_frame frame = { .id = EXT, .length = 8 };
	struct db_bus_config bus = { .baud = 115200, .stop_bits = 1, .bitrate = 1000000 };
	uint8_t shifted[17];

	(void)state;
	memcpy(shifted + 1, &frame, 16);
	/* 27 characters of 10 bits down; fewer up; 150 + 67 bits on the bus */
	assert_int_equal(slcan->wire_time(&bus, shifted + 1, 16, 8), 2343750);
	/* two full frames up: 54 characters */
	assert_int_equal(slcan->wire_time(&bus, shifted + 1, 16, 32), 4687500);
	/* the bus: 150 + 67 bits */
	bus.baud = 3000000;
	assert_int_equal(slcan->wire_time(&bus, shifted + 1, 16, 8), 217000);
	bus.bitrate = 100000;
	assert_int_equal(slcan->wire_time(&bus, shifted + 1, 16, 0), 1500000);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_cannot_be_opened_says_why),
		cmocka_unit_test(the_channel_is_up_once_the_adapter_opened_it),
		cmocka_unit_test(refusals_that_do_not_matter),
		cmocka_unit_test(silence_about_time_stamps_does_not_matter),
		cmocka_unit_test(flushing_waits_for_silence),
		cmocka_unit_test(flushing_ends_even_without_silence),
		cmocka_unit_test(a_bit_rate_that_is_refused_gives_up),
		cmocka_unit_test(an_adapter_that_never_answers_is_given_up),
		cmocka_unit_test(a_channel_that_does_not_open_is_tried_again),
		cmocka_unit_test(frames_pass_both_ways),
		cmocka_unit_test(nothing_is_lost_when_there_is_little_room),
		cmocka_unit_test(frames_that_no_filter_passes_are_dropped),
		cmocka_unit_test(nothing_is_taken_before_the_channel_is_open),
		cmocka_unit_test(a_full_line_takes_a_part_and_the_rest_once),
		cmocka_unit_test(garbage_is_counted),
		cmocka_unit_test(a_pulled_plug_ends_the_port),
		cmocka_unit_test(the_adapter_is_asked_for_its_flags),
		cmocka_unit_test(an_adapter_without_flags_is_asked_once),
		cmocka_unit_test(an_adapter_silent_about_flags_is_asked_three_times),
		cmocka_unit_test(an_adapter_that_falls_silent_is_opened_again),
		cmocka_unit_test(a_channel_that_was_closed_is_opened_again),
		cmocka_unit_test(a_refusal_is_told_from_that_of_a_frame),
		cmocka_unit_test(flags_that_nobody_asked_for_change_no_count),
		cmocka_unit_test(bus_off_closes_and_opens_again),
		cmocka_unit_test(a_full_adapter_is_only_busy),
		cmocka_unit_test(a_full_adapter_that_nobody_acknowledges_is_emptied),
		cmocka_unit_test(refusals_of_everything_open_again),
		cmocka_unit_test(single_refusals_are_counted_only),
		cmocka_unit_test(wire_time_is_that_of_the_slowest_part),
	};

	return cmocka_run_group_tests_name("slcan", tests, NULL, NULL);
}
