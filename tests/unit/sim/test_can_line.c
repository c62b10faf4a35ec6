/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/can_line.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define BITRATE 500000u /* S6 */
#define START (40 * DB_NS_PER_S)
#define FRAME sizeof(struct db_can_frame)

/* From <linux/can/error.h>. */
#define ERROR_BUS_OFF (DB_CAN_ERROR | 0x40u)
#define ERROR_RESTARTED (DB_CAN_ERROR | 0x100u)

/* A drive that answers each frame to it with one of its own, and remembers the last it heard. */
struct drive {
	struct sim_faults faults;
	struct db_can_frame heard;
	unsigned heard_count;
	struct db_can_frame says;
	db_time says_at;
};

struct bench {
	struct sim_can_line *line;
	struct drive drive;
	db_time now;
	uint8_t out[8192];
	size_t out_length;
	char trace[64]; /* the last of it */
	char trace_direction;
};

static void drive_receive(void *self, const struct db_can_frame *frame, db_time now)
{
	struct drive *drive = self;

	(void)now;
	drive->heard = *frame;
	drive->heard_count++;
}

static db_time drive_next(void *self)
{
	return ((const struct drive *)self)->says_at;
}

static bool drive_send(void *self, db_time now, struct db_can_frame *frame)
{
	struct drive *drive = self;

	if (drive->says_at > now)
		return false;
	*frame = drive->says;
	drive->says_at = DB_TIME_NEVER;
	return true;
}

static void note_trace(void *context, db_time time, char direction, const uint8_t *bytes,
                       size_t length)
{
	struct bench *b = context;

	(void)time;
	assert_true(length < sizeof b->trace);
	memcpy(b->trace, bytes, length);
	b->trace[length] = '\0';
	b->trace_direction = direction;
}

static int set_up(void **state, bool adapter)
{
	static struct bench bench;
	const struct sim_can_config config = { .bitrate = BITRATE, .adapter = adapter };
	const struct sim_can_station station = {
		.self = &bench.drive,
		.receive = drive_receive,
		.next = drive_next,
		.send = drive_send,
		.faults = &bench.drive.faults,
	};

	bench = (struct bench){ .now = START, .drive.says_at = DB_TIME_NEVER };
	bench.line = sim_can_line_new(&config, note_trace, &bench);
	assert_non_null(bench.line);
	assert_true(sim_can_bus_attach(bench.line->bus, &station));
	*state = &bench;
	return 0;
}

static int setup_adapter(void **state)
{
	return set_up(state, true);
}

static int setup_frames(void **state)
{
	return set_up(state, false);
}

static int teardown(void **state)
{
	sim_can_line_ops.free(((struct bench *)*state)->line);
	return 0;
}

/* Lets time pass until all is quiet and collects what arrived at the host. */
static void run(struct bench *b)
{
	do {
		db_time next = sim_can_line_ops.next(b->line);
		size_t count;

		if (next != DB_TIME_NEVER && next > b->now)
			b->now = next;
		while ((count = sim_can_line_ops.run(b->line, b->now, b->out + b->out_length,
		                                     sizeof b->out - b->out_length)) > 0)
			b->out_length += count;
	} while (sim_can_line_ops.next(b->line) != DB_TIME_NEVER);
}

static void fault(struct bench *b, const char *text)
{
	assert_null(sim_faults_set(sim_can_line_ops.faults(b->line), text));
}

static void drive_says(struct bench *b, uint32_t id, uint8_t length)
{
	b->drive.says = (struct db_can_frame){ .id = id, .length = length, .data = { 0xA, 0xB } };
	b->drive.says_at = b->now;
}

/* --- an adapter ----------------------------------------------------------------------------------- */

static void tell(struct bench *b, const char *text)
{
	sim_can_line_ops.receive(b->line, (const uint8_t *)text, strlen(text), b->now);
}

/* Says something and expects exactly this in return. */
static void expect(struct bench *b, const char *text, const char *answer)
{
	b->out_length = 0;
	tell(b, text);
	run(b);
	b->out[b->out_length] = '\0';
	assert_string_equal((const char *)b->out, answer);
}

static void open_at(struct bench *b, const char *rate)
{
	expect(b, "C\r", "\r");
	expect(b, rate, "\r");
	expect(b, "O\r", "\r");
}

static void an_adapter_opens_and_closes_once(void **state)
{
	struct bench *b = *state;

	expect(b, "S6\r", "\r");
	expect(b, "O\r", "\r");
	/* Open already: neither again, nor another rate. */
	expect(b, "O\r", "\a");
	expect(b, "L\r", "\a");
	expect(b, "S8\r", "\a");
	/* Closing what is closed is how hosts begin. */
	expect(b, "C\r", "\r");
	expect(b, "C\r", "\r");
	expect(b, "S8\r", "\r");
}

static void an_adapter_tells_who_it_is(void **state)
{
	struct bench *b = *state;

	expect(b, "\r", "\r");
	expect(b, "V\r", "V1013\r");
	expect(b, "N\r", "NDB01\r");
	expect(b, "Z0\r", "\r");
	expect(b, "s031C\r", "\a");
	expect(b, "Q\r", "\a");
	expect(b, "S9\r", "\a");
	expect(b, "this is much longer than any line of the protocol\r", "\a");
	expect(b, "V\r", "V1013\r");
}

static void a_closed_adapter_sends_nothing(void **state)
{
	struct bench *b = *state;

	expect(b, "S6\r", "\r");
	expect(b, "t1232AABB\r", "\a");
	expect(b, "F\r", "\a");
	drive_says(b, 0x321, 2);
	expect(b, "", "");
	assert_int_equal(b->drive.heard_count, 0);
}

static void frames_to_the_drives(void **state)
{
	struct bench *b = *state;

	open_at(b, "S6\r");
	expect(b, "t1232AABB\r", "z\r");
	assert_int_equal(b->drive.heard.id, 0x123);
	assert_int_equal(b->drive.heard.length, 2);
	assert_int_equal(b->drive.heard.data[0], 0xAA);
	assert_int_equal(b->drive.heard.data[1], 0xBB);
	assert_string_equal(b->trace, "123#AABB");
	assert_int_equal(b->trace_direction, '>');
	expect(b, "T0008079E20003\r", "Z\r");
	assert_int_equal(b->drive.heard.id, 0x0008079E | DB_CAN_EXTENDED);
	assert_string_equal(b->trace, "0008079E#0003");
	assert_int_equal(b->drive.heard_count, 2);
	/* More digits than the length says, fewer, and an id beyond its kind. */
	expect(b, "t1231AABB\r", "\a");
	expect(b, "t1233AABB\r", "\a");
	expect(b, "t8001AA\r", "\a");
	assert_int_equal(b->drive.heard_count, 2);
}

static void frames_from_the_drives(void **state)
{
	struct bench *b = *state;

	open_at(b, "S6\r");
	drive_says(b, 0x321, 2);
	expect(b, "", "t32120A0B\r");
	assert_string_equal(b->trace, "321#0A0B");
	assert_int_equal(b->trace_direction, '<');
	drive_says(b, 0x00180202 | DB_CAN_EXTENDED, 4);
	expect(b, "", "T0018020240A0B0000\r");
	drive_says(b, 0x7FF, 0);
	expect(b, "", "t7FF0\r");
}

/* Half a line waits for the rest. */
static void lines_come_in_pieces(void **state)
{
	struct bench *b = *state;

	open_at(b, "S6\r");
	expect(b, "t12", "");
	expect(b, "32AABB", "");
	assert_int_equal(b->drive.heard_count, 0);
	expect(b, "\rt1", "z\r");
	assert_int_equal(b->drive.heard_count, 1);
}

static void a_listening_adapter_only_listens(void **state)
{
	struct bench *b = *state;

	expect(b, "S6\r", "\r");
	expect(b, "L\r", "\r");
	expect(b, "t1230\r", "\a");
	assert_int_equal(b->drive.heard_count, 0);
	drive_says(b, 0x321, 2);
	expect(b, "", "t32120A0B\r");
}

/* Nobody acknowledges what is sent at another rate, and nothing can be understood. */
static void another_rate_is_a_bus_error(void **state)
{
	struct bench *b = *state;

	open_at(b, "S8\r");
	expect(b, "t1230\r", "\a");
	expect(b, "F\r", "F80\r");
	/* Told once. */
	expect(b, "F\r", "F00\r");
	drive_says(b, 0x321, 2);
	expect(b, "", "");
	assert_int_equal(b->drive.heard_count, 0);
	open_at(b, "S6\r");
	expect(b, "t1230\r", "z\r");
	assert_int_equal(b->drive.heard_count, 1);
}

static void an_adapter_has_so_much_room(void **state)
{
	struct bench *b = *state;
	unsigned taken = 0;

	open_at(b, "S6\r");
	b->out_length = 0;
	for (int i = 0; i < 100; i++)
		tell(b, "t1230\r");
	run(b);
	for (size_t i = 0; i < b->out_length; i++)
		taken += b->out[i] == 'z';
	assert_in_range(taken, 8, 64);
	assert_int_equal(b->out_length, 2 * taken + (100 - taken));
	assert_int_equal(b->drive.heard_count, taken);
	expect(b, "F\r", "F02\r");
}

static void lost_arbitration_shows_in_the_flags(void **state)
{
	struct bench *b = *state;

	open_at(b, "S6\r");
	drive_says(b, 0x001, 2);
	expect(b, "t1230\r", "z\rt00120A0B\r");
	expect(b, "F\r", "F40\r");
	expect(b, "F\r", "F00\r");
}

static void an_adapter_off_the_bus_refuses(void **state)
{
	struct bench *b = *state;

	open_at(b, "S6\r");
	fault(b, "bus-off on");
	run(b);
	expect(b, "t1230\r", "\a");
	expect(b, "F\r", "FA0\r");
	/* That goes on. */
	expect(b, "F\r", "FA0\r");
	drive_says(b, 0x321, 2);
	expect(b, "", "");
	fault(b, "bus-off off");
	run(b);
	assert_int_equal(b->drive.heard_count, 0);
	expect(b, "F\r", "F00\r");
	expect(b, "t1230\r", "z\r");
	assert_int_equal(b->drive.heard_count, 1);
}

/* --- frames from and to an interface --------------------------------------------------------------- */

static struct db_can_frame got(const struct bench *b, size_t place)
{
	struct db_can_frame frame;

	assert_true((place + 1) * FRAME <= b->out_length);
	memcpy(&frame, b->out + place * FRAME, FRAME);
	return frame;
}

static void give(struct bench *b, uint32_t id)
{
	const struct db_can_frame frame = { .id = id, .length = 1, .data = { 7 } };

	sim_can_line_ops.receive(b->line, (const uint8_t *)&frame, FRAME, b->now);
	run(b);
}

static void frames_pass_as_they_are(void **state)
{
	struct bench *b = *state;

	give(b, 0x0008079E | DB_CAN_EXTENDED);
	assert_int_equal(b->drive.heard_count, 1);
	assert_int_equal(b->drive.heard.id, 0x0008079E | DB_CAN_EXTENDED);
	assert_int_equal(b->drive.heard.data[0], 7);
	/* Nothing answers but drives. */
	assert_int_equal(b->out_length, 0);
	drive_says(b, 0x321, 2);
	run(b);
	assert_int_equal(b->out_length, FRAME);
	assert_int_equal(got(b, 0).id, 0x321);
	assert_int_equal(got(b, 0).length, 2);
	assert_int_equal(got(b, 0).data[1], 0xB);
}

static void frames_come_in_pieces(void **state)
{
	struct bench *b = *state;
	const struct db_can_frame frame = { .id = 0x123, .length = 1 };
	const uint8_t *bytes = (const uint8_t *)&frame;

	sim_can_line_ops.receive(b->line, bytes, 5, b->now);
	run(b);
	assert_int_equal(b->drive.heard_count, 0);
	sim_can_line_ops.receive(b->line, bytes + 5, FRAME - 5, b->now);
	run(b);
	assert_int_equal(b->drive.heard.id, 0x123);
}

/* What a controller tells of itself, and requests for data, are not for drives. */
static void error_and_remote_frames_stay_outside(void **state)
{
	struct bench *b = *state;

	give(b, ERROR_BUS_OFF);
	give(b, 0x123 | DB_CAN_REMOTE);
	assert_int_equal(b->drive.heard_count, 0);
	give(b, 0x123);
	assert_int_equal(b->drive.heard_count, 1);
}

static void bus_off_and_restart_are_told_once(void **state)
{
	struct bench *b = *state;

	fault(b, "bus-off on");
	run(b);
	run(b);
	assert_int_equal(b->out_length, FRAME);
	assert_int_equal(got(b, 0).id, ERROR_BUS_OFF);
	assert_int_equal(got(b, 0).length, DB_CAN_DATA_MAX);
	give(b, 0x123);
	drive_says(b, 0x321, 2);
	run(b);
	assert_int_equal(b->drive.heard_count, 0);
	assert_int_equal(b->out_length, FRAME);
	fault(b, "bus-off off");
	run(b);
	assert_int_equal(b->out_length, 2 * FRAME);
	assert_int_equal(got(b, 1).id, ERROR_RESTARTED);
	give(b, 0x124);
	assert_int_equal(b->drive.heard_count, 1);
	assert_int_equal(b->drive.heard.id, 0x124);
}

/* For the control socket. */
static void it_tells_what_was_on_the_wire(void **state)
{
	struct bench *b = *state;
	char text[256];

	give(b, 0x123);
	give(b, 0x124);
	drive_says(b, 0x321, 2);
	run(b);
	sim_can_line_ops.describe(b->line, text, sizeof text);
	assert_non_null(strstr(text, "frames=3 requests=2 replies=1 "));
	assert_non_null(strstr(text, "overflows=0 "));
}

#define ADAPTER(function) cmocka_unit_test_setup_teardown(function, setup_adapter, teardown)
#define FRAMES(function) cmocka_unit_test_setup_teardown(function, setup_frames, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		ADAPTER(an_adapter_opens_and_closes_once),
		ADAPTER(an_adapter_tells_who_it_is),
		ADAPTER(a_closed_adapter_sends_nothing),
		ADAPTER(frames_to_the_drives),
		ADAPTER(frames_from_the_drives),
		ADAPTER(lines_come_in_pieces),
		ADAPTER(a_listening_adapter_only_listens),
		ADAPTER(another_rate_is_a_bus_error),
		ADAPTER(an_adapter_has_so_much_room),
		ADAPTER(lost_arbitration_shows_in_the_flags),
		ADAPTER(an_adapter_off_the_bus_refuses),
		FRAMES(frames_pass_as_they_are),
		FRAMES(frames_come_in_pieces),
		FRAMES(error_and_remote_frames_stay_outside),
		FRAMES(bus_off_and_restart_are_told_once),
		FRAMES(it_tells_what_was_on_the_wire),
	};

	return cmocka_run_group_tests_name("sim can line", tests, NULL, NULL);
}
