/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/can_bus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define BITRATE 500000u
#define START (40 * DB_NS_PER_S)
#define STATIONS 3
#define FRAMES_MAX 64

/* A drive that sends what a test gives it and remembers what it hears. */
struct drive {
	struct sim_faults faults;
	struct {
		db_time due;
		struct db_can_frame frame;
	} queue[8];
	size_t first;
	size_t count;
	struct db_can_frame heard[FRAMES_MAX];
	db_time heard_at;
	size_t heard_count;
};

struct wire_event {
	db_time end;
	char direction;
	uint32_t id;
};

struct bench {
	struct sim_can_bus *bus;
	struct drive drives[STATIONS];
	struct wire_event wire[FRAMES_MAX];
	size_t wire_count;
	struct db_can_frame got[FRAMES_MAX]; /* by the host */
	size_t got_count;
	db_time now;
};

static void drive_receive(void *self, const struct db_can_frame *frame, db_time now)
{
	struct drive *drive = self;

	assert_true(drive->heard_count < FRAMES_MAX);
	drive->heard[drive->heard_count++] = *frame;
	drive->heard_at = now;
}

static db_time drive_next(void *self)
{
	const struct drive *drive = self;

	return drive->first < drive->count ? drive->queue[drive->first].due : DB_TIME_NEVER;
}

static bool drive_send(void *self, db_time now, struct db_can_frame *frame)
{
	struct drive *drive = self;

	if (drive_next(drive) > now)
		return false;
	*frame = drive->queue[drive->first++].frame;
	return true;
}

static void note_wire(void *context, db_time time, char direction, const struct db_can_frame *frame)
{
	struct bench *b = context;

	assert_true(b->wire_count < FRAMES_MAX);
	b->wire[b->wire_count++] = (struct wire_event){ time, direction, frame->id };
}

static int setup(void **state)
{
	static struct bench bench;

	bench = (struct bench){ .now = START };
	bench.bus = sim_can_bus_new(BITRATE, note_wire, &bench);
	assert_non_null(bench.bus);
	for (size_t i = 0; i < STATIONS; i++) {
		const struct sim_can_station station = {
			.self = &bench.drives[i],
			.receive = drive_receive,
			.next = drive_next,
			.send = drive_send,
			.faults = &bench.drives[i].faults,
		};

		assert_true(sim_can_bus_attach(bench.bus, &station));
	}
	*state = &bench;
	return 0;
}

static int teardown(void **state)
{
	free(((struct bench *)*state)->bus);
	return 0;
}

/* Without data the length of a frame still depends on its id. */
static struct db_can_frame frame_of(uint32_t id, uint8_t length)
{
	struct db_can_frame frame = { .id = id, .length = length };

	for (uint8_t i = 0; i < length; i++)
		frame.data[i] = (uint8_t)(0x11 * (i + 1));
	return frame;
}

static void drive_says(struct bench *b, size_t drive, uint32_t id, db_time due)
{
	struct drive *d = &b->drives[drive];

	d->queue[d->count].due = due;
	d->queue[d->count++].frame = frame_of(id, 8);
}

static void host_says(struct bench *b, uint32_t id)
{
	const struct db_can_frame frame = frame_of(id, 8);

	assert_true(sim_can_bus_put(b->bus, &frame, b->now));
}

/* Lets time pass until all is quiet, waking only when the bus asks for it. */
static void run(struct bench *b)
{
	struct db_can_frame frame;

	while (sim_can_bus_next(b->bus) != DB_TIME_NEVER) {
		db_time next = sim_can_bus_next(b->bus);

		b->now = next > b->now ? next : b->now;
		while (sim_can_bus_run(b->bus, b->now, &frame))
			b->got[b->got_count++] = frame;
	}
}

static db_time time_of(uint32_t id, uint8_t length)
{
	const struct db_can_frame frame = frame_of(id, length);

	return (db_time)db_can_frame_bits(&frame) * (DB_NS_PER_S / BITRATE);
}

static void fault(struct sim_faults *faults, const char *text)
{
	assert_null(sim_faults_set(faults, text));
}

/* --- arbitration and pace ------------------------------------------------------------------------- */

static void a_frame_takes_its_bits(void **state)
{
	struct bench *b = *state;
	const struct db_can_frame frame = frame_of(0x123, 8);

	host_says(b, 0x123);
	assert_int_equal(b->bus->host_count, 1);
	run(b);
	assert_int_equal(b->bus->host_count, 0);
	assert_int_equal(b->wire_count, 1);
	assert_int_equal(b->wire[0].end, START + time_of(0x123, 8));
	for (size_t i = 0; i < STATIONS; i++) {
		assert_int_equal(b->drives[i].heard_count, 1);
		assert_memory_equal(&b->drives[i].heard[0], &frame, sizeof frame);
		assert_int_equal(b->drives[i].heard_at, START + time_of(0x123, 8));
	}
	assert_int_equal(b->got_count, 0);
	assert_int_equal(b->bus->stats.busy_ns, (uint64_t)time_of(0x123, 8));
}

/* 131 bits with eight bytes, up to 29 more to stuff them. */
static void extended_frames_take_longer(void **state)
{
	struct bench *b = *state;

	assert_true(time_of(0x123 | DB_CAN_EXTENDED, 8) > time_of(0x123, 8));
	host_says(b, 0x123 | DB_CAN_EXTENDED);
	run(b);
	assert_int_equal(b->wire[0].end, START + time_of(0x123 | DB_CAN_EXTENDED, 8));
	assert_in_range(b->wire[0].end - START, 131 * (DB_NS_PER_S / BITRATE),
	                160 * (DB_NS_PER_S / BITRATE));
}

static void frames_follow_one_another_without_a_gap(void **state)
{
	struct bench *b = *state;
	db_time end = START;

	for (uint32_t i = 0; i < 20; i++)
		host_says(b, 0x100 + i);
	run(b);
	assert_int_equal(b->wire_count, 20);
	for (uint32_t i = 0; i < 20; i++) {
		end += time_of(0x100 + i, 8);
		assert_int_equal(b->wire[i].id, 0x100 + i);
		assert_int_equal(b->wire[i].end, end);
	}
}

static void the_lowest_id_goes_first(void **state)
{
	struct bench *b = *state;

	drive_says(b, 0, 0x300, START);
	drive_says(b, 1, 0x100, START);
	drive_says(b, 2, 0x7FF, START);
	host_says(b, 0x200);
	run(b);
	assert_int_equal(b->wire_count, 4);
	assert_int_equal(b->wire[0].id, 0x100);
	assert_int_equal(b->wire[0].direction, '<');
	assert_int_equal(b->wire[1].id, 0x200);
	assert_int_equal(b->wire[1].direction, '>');
	assert_int_equal(b->wire[2].id, 0x300);
	assert_int_equal(b->wire[3].id, 0x7FF);
	assert_int_equal(b->bus->stats.arbitration_lost, 1);
	assert_int_equal(b->got_count, 3);
}

/* Of two with the same eleven first bits the standard frame wins. */
static void standard_goes_before_extended(void **state)
{
	struct bench *b = *state;

	drive_says(b, 0, (0x123u << 18) | DB_CAN_EXTENDED, START);
	drive_says(b, 1, (0x122u << 18 | 0x3FFFF) | DB_CAN_EXTENDED, START);
	drive_says(b, 2, 0x123, START);
	run(b);
	assert_int_equal(b->wire[0].id, (0x122u << 18 | 0x3FFFF) | DB_CAN_EXTENDED);
	assert_int_equal(b->wire[1].id, 0x123);
	assert_int_equal(b->wire[2].id, (0x123u << 18) | DB_CAN_EXTENDED);
}

/* However good an id: what is on the wire is not interrupted, and the host keeps its own order. */
static void who_comes_late_waits(void **state)
{
	struct bench *b = *state;

	host_says(b, 0x700);
	host_says(b, 0x500);
	drive_says(b, 0, 0x001, START + 1);
	run(b);
	assert_int_equal(b->wire[0].id, 0x700);
	assert_int_equal(b->wire[1].id, 0x001);
	assert_int_equal(b->wire[2].id, 0x500);
	assert_int_equal(b->wire[1].end - b->wire[0].end, time_of(0x001, 8));
	assert_int_equal(b->bus->stats.arbitration_lost, 1);
}

static void the_host_has_so_much_room(void **state)
{
	struct bench *b = *state;
	const struct db_can_frame frame = frame_of(1, 8);
	size_t taken = 0;

	while (taken < 1000 && sim_can_bus_put(b->bus, &frame, b->now))
		taken++;
	assert_int_equal(taken, b->bus->host_count);
	assert_int_equal(b->bus->stats.overflows, 1);
	assert_in_range(taken, 1, FRAMES_MAX);
	run(b);
	assert_int_equal(b->bus->stats.host_frames, taken);
}

static void only_so_many_stations(void **state)
{
	struct bench *b = *state;
	const struct sim_can_station station = {
		.self = &b->drives[0],
		.receive = drive_receive,
		.next = drive_next,
		.send = drive_send,
		.faults = &b->drives[0].faults,
	};

	for (size_t i = STATIONS; i < SIM_CAN_STATIONS_MAX; i++)
		assert_true(sim_can_bus_attach(b->bus, &station));
	assert_false(sim_can_bus_attach(b->bus, &station));
}

/* --- faults ---------------------------------------------------------------------------------------- */

static void a_dropped_frame_is_never_on_the_wire(void **state)
{
	struct bench *b = *state;

	fault(&b->drives[0].faults, "drop 1");
	drive_says(b, 0, 0x100, START);
	drive_says(b, 0, 0x101, START);
	run(b);
	assert_int_equal(b->wire_count, 1);
	assert_int_equal(b->got_count, 1);
	assert_int_equal(b->got[0].id, 0x101);
}

static void a_lost_request_is_lost_to_one_drive(void **state)
{
	struct bench *b = *state;

	fault(&b->drives[1].faults, "lose-request 1");
	host_says(b, 0x100);
	host_says(b, 0x101);
	run(b);
	assert_int_equal(b->wire_count, 2);
	assert_int_equal(b->drives[0].heard_count, 2);
	assert_int_equal(b->drives[1].heard_count, 1);
	assert_int_equal(b->drives[1].heard[0].id, 0x101);
}

static void a_late_answer_holds_up_those_behind_it(void **state)
{
	struct bench *b = *state;
	const db_time late = START + 20 * DB_NS_PER_MS;

	fault(&b->drives[0].faults, "delay 20 1");
	drive_says(b, 0, 0x100, START);
	drive_says(b, 0, 0x050, START);
	drive_says(b, 1, 0x200, START);
	run(b);
	assert_int_equal(b->wire[0].id, 0x200);
	assert_int_equal(b->wire[1].id, 0x100);
	assert_int_equal(b->wire[1].end, late + time_of(0x100, 8));
	assert_int_equal(b->wire[2].id, 0x050);
}

/* Controllers repeat by themselves: the frame comes whole, only later. */
static void a_corrupted_frame_costs_time_only(void **state)
{
	struct bench *b = *state;
	const struct db_can_frame frame = frame_of(0x100, 8);

	fault(&b->drives[0].faults, "corrupt 1");
	drive_says(b, 0, 0x100, START);
	run(b);
	assert_int_equal(b->got_count, 1);
	assert_memory_equal(&b->got[0], &frame, sizeof frame);
	assert_true(b->wire[0].end > START + time_of(0x100, 8));
	assert_true(b->wire[0].end < START + 2 * time_of(0x100, 8));
	assert_int_equal(b->bus->stats.corrupted, 1);
}

static void half_of_a_truncated_frame_is_missing(void **state)
{
	struct bench *b = *state;

	fault(&b->drives[0].faults, "truncate 1");
	drive_says(b, 0, 0x100, START);
	run(b);
	assert_int_equal(b->got[0].length, 4);
	assert_int_equal(b->wire[0].end, START + time_of(0x100, 4));
}

static void garbage_comes_before_the_frame(void **state)
{
	struct bench *b = *state;

	fault(&b->bus->faults, "garbage 1");
	drive_says(b, 0, 0x100, START);
	run(b);
	assert_int_equal(b->got_count, 2);
	assert_int_not_equal(b->got[0].id, 0x100);
	assert_int_equal(b->got[1].id, 0x100);
}

static void a_doubled_frame_comes_twice(void **state)
{
	struct bench *b = *state;

	fault(&b->drives[0].faults, "double 1");
	drive_says(b, 0, 0x100, START);
	run(b);
	assert_int_equal(b->got_count, 2);
	assert_memory_equal(&b->got[0], &b->got[1], sizeof b->got[0]);
}

/* Drive 1 answers host 1 in the name of another drive. */
static void a_wrong_id_names_another_drive(void **state)
{
	struct bench *b = *state;

	fault(&b->drives[0].faults, "wrong-id 1");
	drive_says(b, 0, 0x00080200 | DB_CAN_EXTENDED, START);
	run(b);
	assert_int_equal(b->got[0].id, 0x00080600 | DB_CAN_EXTENDED);
}

static void a_silent_drive_neither_hears_nor_speaks(void **state)
{
	struct bench *b = *state;

	fault(&b->drives[0].faults, "silence on");
	drive_says(b, 0, 0x100, START);
	host_says(b, 0x200);
	run(b);
	assert_int_equal(b->wire_count, 1);
	assert_int_equal(b->drives[0].heard_count, 0);
	assert_int_equal(b->drives[1].heard_count, 1);
	fault(&b->drives[0].faults, "silence off");
	host_says(b, 0x201);
	run(b);
	assert_int_equal(b->drives[0].heard_count, 1);
}

static void with_echo_the_host_hears_itself(void **state)
{
	struct bench *b = *state;

	fault(&b->bus->faults, "echo on");
	host_says(b, 0x200);
	run(b);
	assert_int_equal(b->got_count, 1);
	assert_int_equal(b->got[0].id, 0x200);
}

/* --- bus off --------------------------------------------------------------------------------------- */

static void a_cut_host_is_not_there(void **state)
{
	struct bench *b = *state;
	const struct db_can_frame frame = frame_of(0x100, 8);

	host_says(b, 0x100);
	sim_can_bus_cut(b->bus, true);
	assert_true(b->bus->cut);
	assert_int_equal(b->bus->host_count, 0);
	assert_false(sim_can_bus_put(b->bus, &frame, b->now));
	drive_says(b, 0, 0x200, START);
	run(b);
	/* The drives still have their bus. */
	assert_int_equal(b->wire_count, 1);
	assert_int_equal(b->got_count, 0);
	assert_int_equal(b->drives[0].heard_count, 0);

	sim_can_bus_cut(b->bus, false);
	host_says(b, 0x101);
	drive_says(b, 0, 0x201, b->now);
	run(b);
	/* Nothing of before comes after. */
	assert_int_equal(b->drives[0].heard_count, 1);
	assert_int_equal(b->drives[0].heard[0].id, 0x101);
	assert_int_equal(b->got_count, 1);
	assert_int_equal(b->got[0].id, 0x201);
}

#define CASE(function) cmocka_unit_test_setup_teardown(function, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		CASE(a_frame_takes_its_bits),
		CASE(extended_frames_take_longer),
		CASE(frames_follow_one_another_without_a_gap),
		CASE(the_lowest_id_goes_first),
		CASE(standard_goes_before_extended),
		CASE(who_comes_late_waits),
		CASE(the_host_has_so_much_room),
		CASE(only_so_many_stations),
		CASE(a_dropped_frame_is_never_on_the_wire),
		CASE(a_lost_request_is_lost_to_one_drive),
		CASE(a_late_answer_holds_up_those_behind_it),
		CASE(a_corrupted_frame_costs_time_only),
		CASE(half_of_a_truncated_frame_is_missing),
		CASE(garbage_comes_before_the_frame),
		CASE(a_doubled_frame_comes_twice),
		CASE(a_wrong_id_names_another_drive),
		CASE(a_silent_drive_neither_hears_nor_speaks),
		CASE(with_echo_the_host_hears_itself),
		CASE(a_cut_host_is_not_there),
	};

	return cmocka_run_group_tests_name("sim can bus", tests, NULL, NULL);
}
