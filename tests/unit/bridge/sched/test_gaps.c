/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that do not hear for a while after their replies, or answer late, with nothing configured for it: the real engine
 * and driver beside simulated VSMD drives on RS485 in made-up time, byte by byte.
 */
#include "fakes/rs485.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define US DB_NS_PER_US

/* --- what is learnt ------------------------------------------------------------------------------ */

static const unsigned one[] = { 1, 0 };
static const unsigned four[] = { 3, 4, 5, 6, 0 };
static const unsigned twelve[] = { 3, 4, 5, 6, 7, 8, 9, 21, 22, 23, 24, 25, 0 };

/* It comes online and does what it is told, each time and at once. */
static void expect_obedience(struct rs485 *line, size_t drive)
{
	fake_pass(line->bus, 3000 * MS);
	assert_true(fake_is_online(line->bus, drive));
	assert_int_equal(rs485_enable(line, drive), DB_RESULT_OK);
	for (unsigned i = 0; i < 20; i++) {
		assert_int_equal(rs485_turn(line, drive, 400.0f + (float)i), DB_RESULT_OK);
		fake_pass(line->bus, (7 + 3 * i) * MS);
		assert_int_equal(
			rs485_command(line, drive, (struct db_request){ .command = DB_CMD_STOP }),
			DB_RESULT_OK);
		fake_pass(line->bus, (31 - i) * MS);
	}
	assert_true(fake_is_online(line->bus, drive));
}

static void a_deaf_drive_gets_its_gap(void **state)
{
	(void)state;
	print_message("deaf us   learnt us (0: as configured, 1000)   lost requests\n");
	for (db_time deaf = 0; deaf <= 8 * MS; deaf += 500 * US) {
		struct rs485 *line = rs485_new(one);
		struct db_snapshot snapshot;

		line->nodes[0].deaf = deaf;
		rs485_begin(line);
		expect_obedience(line, 0);
		snapshot = fake_snapshot(line->bus, 0);
		print_message("%7d   %9u   %4u\n", (int)(deaf / US), snapshot.learnt.gap_us,
		              (unsigned)snapshot.stats.timeouts);
		assert_true((snapshot.learnt.gap_us == 0 ? 1000 : snapshot.learnt.gap_us) * US >=
		            deaf);
		assert_int_equal(line->told[DB_EVENT_DRIVE_DEAF] > 0, deaf > 1 * MS);
		assert_int_equal(snapshot.learnt.latency_ms, 0);
		rs485_free(line);
	}
}

static void a_late_drive_is_waited_for(void **state)
{
	(void)state;
	print_message("late ms   learnt ms (0: as configured, 30)   lost requests\n");
	for (db_time late = 0; late <= 60 * MS; late += 4 * MS) {
		struct rs485 *line = rs485_new(one);
		struct db_snapshot snapshot;

		line->nodes[0].latency = late;
		rs485_begin(line);
		expect_obedience(line, 0);
		snapshot = fake_snapshot(line->bus, 0);
		print_message("%7d   %9u   %4u\n", (int)(late / MS), snapshot.learnt.latency_ms,
		              (unsigned)snapshot.stats.timeouts);
		assert_int_equal(line->told[DB_EVENT_DRIVE_DEAF], 0);
		assert_int_equal(snapshot.learnt.latency_ms > 30, late > 28 * MS);
		rs485_free(line);
	}
}

/* Its answers end when they are just given up: what has begun is not talked over. */
static void a_drive_that_is_late_by_just_too_much_is_understood(void **state)
{
	(void)state;
	for (db_time late = 28 * MS; late <= 34 * MS; late += MS / 4) {
		struct rs485 *line = rs485_new(one);

		line->nodes[0].latency = late;
		rs485_begin(line);
		expect_obedience(line, 0);
		assert_in_range(fake_snapshot(line->bus, 0).stats.timeouts, 0, 6);
		rs485_free(line);
	}
}

/* The line is held by whoever has answered: others do not hear either. */
static void a_drive_that_holds_the_line_is_given_time(void **state)
{
	(void)state;
	for (db_time hold = 0; hold <= 8 * MS; hold += 2 * MS) {
		struct rs485 *line = rs485_new(four);

		line->config.line_hold = hold;
		rs485_begin(line);
		for (size_t i = 0; i < 4; i++)
			expect_obedience(line, i);
		assert_int_equal(line->told_others > 0, hold > 1 * MS);
		rs485_free(line);
	}
}

/* Samples of each other drive in two seconds, with one like this on the line. */
static uint32_t neighbours_samples(db_time deaf)
{
	struct rs485 *line = rs485_new(four);
	uint32_t before;
	uint32_t after;

	line->bus->config.cycle_ms = 50;
	line->nodes[0].deaf = deaf;
	rs485_begin(line);
	fake_pass(line->bus, 5000 * MS);
	before = rs485_samples(line, 1);
	fake_pass(line->bus, 2000 * MS);
	after = rs485_samples(line, 1);
	rs485_free(line);
	return after - before;
}

static void a_deaf_drive_does_not_slow_its_neighbours(void **state)
{
	uint32_t plain = neighbours_samples(0);

	(void)state;
	assert_in_range(plain, 39, 41);
	for (db_time deaf = 1 * MS; deaf <= 8 * MS; deaf += 1 * MS)
		assert_in_range(neighbours_samples(deaf), plain - 1, plain + 1);
}

/* Samples of one of twelve in ten seconds, on a line that has no room for a cycle: all in turn. */
static uint32_t crowded_samples(bool adapt)
{
	struct rs485 *line = rs485_new(twelve);
	uint32_t before;
	uint32_t after;

	line->bus->config.cycle_ms = 5;
	line->bus->config.adapt = adapt;
	rs485_begin(line);
	fake_pass(line->bus, 60 * DB_NS_PER_S);
	if (adapt)
		assert_in_range(fake_snapshot(line->bus, 0).learnt.gap_us, 300, 310);
	before = rs485_samples(line, 0);
	fake_pass(line->bus, 10 * DB_NS_PER_S);
	after = rs485_samples(line, 0);
	assert_int_equal(fake_snapshot(line->bus, 0).stats.timeouts, 0);
	rs485_free(line);
	return after - before;
}

static void a_line_of_drives_that_hear_gets_faster(void **state)
{
	uint32_t as_configured = crowded_samples(false);
	uint32_t as_learnt = crowded_samples(true);

	(void)state;
	print_message("samples of one of twelve in ten seconds: %u with adapt = off, %u with on\n",
	              (unsigned)as_configured, (unsigned)as_learnt);
	/* 3.3 ms for bytes and thinking, and 0.3 in the place of 1. */
	assert_true(as_learnt * 10 > as_configured * 11);
}

static const unsigned thirty_two[] = { 1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11,
	                               12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22,
	                               23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 0 };

/* As with a file that says nothing but the baud rate: a cycle of 20 ms, in which not all have room. */
static struct rs485 *new_full_line(void)
{
	struct rs485 *line = rs485_new(thirty_two);

	line->bus->config.cycle_ms = 20;
	return line;
}

/* How long a round over all of them takes, on average of ten seconds. */
static db_time round_time(struct rs485 *line)
{
	uint32_t samples = 0;

	for (size_t i = 0; i < 32; i++)
		samples -= rs485_samples(line, i);
	fake_pass(line->bus, 10 * DB_NS_PER_S);
	for (size_t i = 0; i < 32; i++)
		samples += rs485_samples(line, i);
	return 32 * 10 * DB_NS_PER_S / samples;
}

static void a_full_line_gets_faster_by_what_it_learns(void **state)
{
	struct rs485 *line = new_full_line();
	db_time before;
	db_time after;

	(void)state;
	line->config.latency = 0;
	line->bus->config.adapt = false;
	rs485_begin(line);
	fake_pass(line->bus, 3 * DB_NS_PER_S);
	before = round_time(line);
	rs485_free(line);
	line = new_full_line();
	line->config.latency = 0;
	rs485_begin(line);
	fake_pass(line->bus, 20 * DB_NS_PER_S);
	after = round_time(line);
	assert_int_equal(fake_snapshot(line->bus, 7).stats.timeouts, 0);
	rs485_free(line);
	print_message("a round over 32 drives: %.1f ms as configured, %.1f ms as learnt\n",
	              (double)before / 1e6, (double)after / 1e6);
	/* 2.6 ms for bytes, and a gap of 1 ms, or of 3.5 characters. */
	assert_in_range(before, 110 * MS, 117 * MS);
	assert_in_range(after, 86 * MS, 92 * MS);
}

/* Of a drive that is deaf after its answers nothing is known when its first command is a stop. */
static void the_first_stop_of_a_deaf_drive_is_heard_on_a_full_line(void **state)
{
	db_time longest = 0;

	(void)state;
	for (db_time deaf = 0; deaf <= 8 * MS; deaf += 2 * MS) {
		for (unsigned turn = 0; turn < 4; turn++) {
			struct rs485 *line = new_full_line();
			db_time posted;

			line->nodes[6].deaf = deaf;
			rs485_begin(line);
			while (!fake_is_online(line->bus, 6))
				fake_pass(line->bus, MS);
			fake_pass(line->bus, turn * 33 * MS);
			posted = line->bus->now;
			fake_post(line->bus, 6, DB_CMD_STOP);
			while (rs485_count_heard(&line->nodes[6], "7 stp") == 0) {
				fake_pass(line->bus, MS / 4);
				assert_true(line->bus->now - posted < 200 * MS);
			}
			if (line->bus->now - posted > longest)
				longest = line->bus->now - posted;
			fake_pass(line->bus, 1000 * MS);
			assert_int_equal(fake_result(line->bus), DB_RESULT_OK);
			assert_true(fake_is_online(line->bus, 6));
			rs485_free(line);
		}
	}
	print_message("first stop of a deaf drive among 32: heard after at most %.1f ms\n",
	              (double)longest / 1e6);
}

static void nothing_is_learnt_where_that_is_off(void **state)
{
	struct rs485 *line = rs485_new(one);
	struct db_snapshot snapshot;

	(void)state;
	line->bus->config.adapt = false;
	line->nodes[0].deaf = 4 * MS;
	rs485_begin(line);
	for (unsigned i = 0; i < 20; i++)
		(void)rs485_command(line, 0,
		                    (struct db_request){ .command = DB_CMD_READ_PARAMETERS });
	snapshot = fake_snapshot(line->bus, 0);
	assert_int_equal(snapshot.learnt.gap_us, 0);
	assert_int_equal(snapshot.learnt.latency_ms, 0);
	assert_true(line->told[DB_EVENT_DRIVE_DEAF] > 0);
	assert_int_equal(line->learnt, 0);
	rs485_free(line);
}

/* --- who waits for that -------------------------------------------------------------------------- */

static const unsigned two_twelve_and_more[] = { 2, 12, 22, 32, 0 };

/* How long it took from now until each of the drives `from` to the last had heard its stop, while drive 2 tells its status
 * unasked in each millisecond. */
static void babble_until_stopped(struct rs485 *line, size_t from, db_time *waited)
{
	static const uint8_t status[] = { 0xFF, 0x02, 0x02, 0, 0, 0,    0,    0, 0,    0,   0,
		                          0,    0,    0,    0, 0, 0x63, 0x33, 0, 0x50, 0xFE };
	char words[FAKE_DRIVES][16];

	for (size_t i = from; i < line->bus->drive_count; i++) {
		(void)snprintf(words[i], sizeof words[i], "%u stp", line->bus->drives[i].address);
		waited[i] = 0;
	}
	for (db_time ms = 1; ms <= 300; ms++) {
		fake_receive(line->bus, status, sizeof status);
		fake_pass(line->bus, MS);
		for (size_t i = from; i < line->bus->drive_count; i++)
			if (waited[i] == 0 && rs485_count_heard(&line->nodes[i], words[i]) > 0)
				waited[i] = ms * MS;
	}
}

/* Stops that wait for the same drive to hear do not put each other off. */
static void a_drive_that_talks_keeps_no_stop_for_long(void **state)
{
	struct rs485 *line = rs485_new(two_twelve_and_more);
	db_time waited[FAKE_DRIVES];

	(void)state;
	/* It may be deaf for 8 ms each time, for all that is known. */
	line->bus->config.turnaround_us = 8000;
	rs485_begin(line);
	fake_pass(line->bus, 500 * MS);
	for (size_t i = 1; i < 4; i++)
		fake_post(line->bus, i, DB_CMD_STOP);
	babble_until_stopped(line, 1, waited);
	for (size_t i = 1; i < 4; i++) {
		print_message("stop of drive %u: %d ms\n", line->bus->drives[i].address,
		              (int)(waited[i] / MS));
		/* For each 24 ms, and the wait for an answer that the talk may have covered. */
		assert_in_range(waited[i], 1, 3 * (24 + 35) * MS);
	}
	rs485_free(line);
}

/* --- what must not be misheard ------------------------------------------------------------------- */

/*
 * Beside 12 stands a drive that turns its line round for any number of bytes: it must never hear what is said to 12. Nor
 * must it hear of "10 ..." what is for all.
 */
static void expect_no_mishearing(const unsigned *addresses, size_t other, const char *address)
{
	char stop[16];
	char move[16];
	char power[16];

	(void)snprintf(stop, sizeof stop, "%s stp", address);
	(void)snprintf(move, sizeof move, "%s mov", address);
	(void)snprintf(power, sizeof power, "%s ena", address);
	for (db_time deaf = 0; deaf <= 8 * MS; deaf += RS485_CHARACTER / 2) {
		struct rs485 *line = rs485_new(addresses);
		const struct sim_node *node = &line->nodes[0];

		line->nodes[0].deaf = deaf;
		rs485_begin(line);
		fake_pass(line->bus, 100 * MS + 37 * deaf % MS);
		for (unsigned i = 0; i < 8; i++) {
			(void)rs485_enable(line, other);
			(void)rs485_turn(line, other, 400.0f);
			fake_pass(line->bus, 3 * MS + i * 777 * US);
			fake_post(line->bus, other, DB_CMD_STOP);
			for (unsigned k = 0; k < 15; k++) {
				fake_pass(line->bus, 1 * MS);
				assert_int_equal(rs485_count_heard(node, stop), 0);
				assert_int_equal(rs485_count_heard(node, move), 0);
				assert_int_equal(rs485_count_heard(node, power), 0);
			}
			while (fake_result(line->bus) != DB_RESULT_NONE)
				;
		}
		rs485_free(line);
	}
}

static void who_misses_a_beginning_hears_nothing_for_itself(void **state)
{
	static const unsigned two_and_twelve[] = { 2, 12, 0 };

	(void)state;
	expect_no_mishearing(two_and_twelve, 1, "2");
}

static void who_misses_a_beginning_hears_nothing_for_all(void **state)
{
	static const unsigned five_and_ten[] = { 5, 10, 0 };

	(void)state;
	expect_no_mishearing(five_and_ten, 1, "0");
}

static void requests_say_who_could_mishear_them(void **state)
{
	static const struct {
		const char *request;
		unsigned address;
		bool mishears;
	} cases[] = {
		{ "12 stp\n", 2, true },        { "\n12 stp\n", 2, true },
		{ "12 stp\n", 1, false },       { "12 stp\n", 12, false },
		{ "2 stp\n", 12, false },       { "32 sts\n", 2, true },
		{ "10 stp\n", 7, true },        { "20 ena\n", 3, true },
		{ "11 stp\n", 1, true },        { "5 pos 100\n", 7, false },
		{ "5 pos 17\n", 7, true },      { "5 mov spd=0.5\n", 7, false },
		{ "5 mov spd=0.5\n", 5, true }, { "1 stp\n", 11, false },
	};
	const struct db_driver *driver = db_driver_find("vsmd-serial");

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
		assert_int_equal(driver->mishears(cases[i].address,
		                                  (const uint8_t *)cases[i].request,
		                                  strlen(cases[i].request)),
		                 cases[i].mishears);
	assert_null(db_driver_find("xyza")->mishears);
	assert_null(db_driver_find("vsmd-can")->mishears);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_deaf_drive_gets_its_gap),
		cmocka_unit_test(a_late_drive_is_waited_for),
		cmocka_unit_test(a_drive_that_is_late_by_just_too_much_is_understood),
		cmocka_unit_test(a_drive_that_holds_the_line_is_given_time),
		cmocka_unit_test(a_deaf_drive_does_not_slow_its_neighbours),
		cmocka_unit_test(a_line_of_drives_that_hear_gets_faster),
		cmocka_unit_test(a_full_line_gets_faster_by_what_it_learns),
		cmocka_unit_test(the_first_stop_of_a_deaf_drive_is_heard_on_a_full_line),
		cmocka_unit_test(nothing_is_learnt_where_that_is_off),
		cmocka_unit_test(a_drive_that_talks_keeps_no_stop_for_long),
		cmocka_unit_test(who_misses_a_beginning_hears_nothing_for_itself),
		cmocka_unit_test(who_misses_a_beginning_hears_nothing_for_all),
		cmocka_unit_test(requests_say_who_could_mishear_them),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
