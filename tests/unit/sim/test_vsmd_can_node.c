/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/vsmd_can_node.h"

#include "sim/node.h"
#include "sim/vsmd_drive.h"
#include "sim/vsmd_mechanics.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define START (40 * DB_NS_PER_S)
#define LATENCY (200 * DB_NS_PER_US)
#define TEXT_MAX 32

struct bench {
	struct sim_node node;
	struct sim_vsmd_can_node can;
	struct sim_can_station station;
	db_time now;
	char said[TEXT_MAX];
};

static int set_up(void **state, const struct vsmd_can_style *style, unsigned baud)
{
	static struct bench bench;
	struct sim_vsmd_config drive;

	bench = (struct bench){ .now = START };
	sim_vsmd_config_init(&drive, 1, baud);
	drive.can = true;
	drive.identity = "VSMD106-025T-1.0.040.171101";
	drive.defaults[VSMD_PAE].u = 1;
	bench.node.name = "drive";
	bench.node.drive = sim_vsmd_new(&drive, START);
	assert_non_null(bench.node.drive);
	sim_vsmd_can_node_init(&bench.can, &bench.node, style, LATENCY);
	bench.station = sim_vsmd_can_node_station(&bench.can);
	*state = &bench;
	return 0;
}

static int setup(void **state)
{
	const struct vsmd_can_style style = { .extended = true, .output_base = 1 };

	return set_up(state, &style, 500000);
}

static int setup_standard(void **state)
{
	const struct vsmd_can_style style = { .extended = false, .output_base = 1 };

	return set_up(state, &style, 100000);
}

static int teardown(void **state)
{
	free(((struct bench *)*state)->node.drive);
	return 0;
}

/* "0008079E#0003": eight digits make an extended frame. */
static void hear(struct bench *b, const char *text)
{
	struct db_can_frame frame = { .length = 0 };
	const char *data = strchr(text, '#') + 1;
	unsigned id;
	unsigned byte;

	assert_int_equal(sscanf(text, "%x", &id), 1);
	frame.id = id | (data - text > 4 ? DB_CAN_EXTENDED : 0);
	for (; sscanf(data, "%2x", &byte) == 1; data += 2)
		frame.data[frame.length++] = (uint8_t)byte;
	b->station.receive(b->station.self, &frame, b->now);
}

/* What the drive says next, once that is due; "" when it has nothing to say. */
static const char *next(struct bench *b)
{
	db_time due = b->station.next(b->station.self);
	struct db_can_frame frame;
	int length;

	b->said[0] = '\0';
	if (due == DB_TIME_NEVER)
		return b->said;
	assert_false(b->station.send(b->station.self, due - 1, &frame));
	b->now = due > b->now ? due : b->now;
	assert_true(b->station.send(b->station.self, b->now, &frame));
	length = snprintf(b->said, sizeof b->said, frame.id & DB_CAN_EXTENDED ? "%08X#" : "%03X#",
	                  frame.id & DB_CAN_ID_MASK);
	for (unsigned i = 0; i < frame.length; i++)
		length += snprintf(b->said + length, sizeof b->said - (size_t)length, "%02X",
		                   frame.data[i]);
	return b->said;
}

static struct vsmd_status status_of(struct bench *b)
{
	struct vsmd_status status;

	sim_vsmd_status(b->node.drive, b->now, &status);
	return status;
}

static uint32_t refusals(const struct bench *b)
{
	return b->node.drive->refusals;
}

static uint32_t count(const struct bench *b, enum vsmd_verb verb)
{
	return b->node.drive->counts[verb];
}

/* --- reading --------------------------------------------------------------------------------------- */

/* The frames captured from drives: host 3 asks drive 1. */
static void status_as_captured(void **state)
{
	struct bench *b = *state;
	char word[TEXT_MAX];

	hear(b, "0008079E#0003");
	assert_int_equal(b->station.next(b->station.self), START + LATENCY);
	assert_string_equal(next(b), "00180200#0000000000000000");
	(void)snprintf(word, sizeof word, "00180202#%08X", status_of(b).status);
	assert_string_equal(next(b), word);
	assert_string_equal(next(b), "");
}

static void data_as_captured(void **state)
{
	struct bench *b = *state;

	hear(b, "0008079F#0002");
	assert_string_equal(next(b), "00180280#0000000100012132");
	assert_string_equal(next(b), "");
}

static void position_and_status_alone(void **state)
{
	struct bench *b = *state;
	char text[TEXT_MAX];

	hear(b, "00080383#00001267");
	hear(b, "0008039E#0102");
	(void)snprintf(text, sizeof text, "00080201#00001267%08X", status_of(b).status);
	assert_string_equal(next(b), text);
	assert_string_equal(next(b), "");
}

/* Four characters a register, blanks at the end. */
static void identity_as_text(void **state)
{
	struct bench *b = *state;

	hear(b, "0008039E#0A07");
	assert_string_equal(next(b), "0008020A#56534D443130362D");
	assert_string_equal(next(b), "0008020C#303235542D312E30");
	assert_string_equal(next(b), "0008020E#2E3034302E313731");
	assert_string_equal(next(b), "00080210#31303120");
	assert_string_equal(next(b), "");
}

/* One after the other, in the order of the questions, each to who asked. */
static void answers_come_in_order(void **state)
{
	struct bench *b = *state;

	hear(b, "0008079F#0001");
	hear(b, "0008039F#0001");
	hear(b, "00081F9F#0001");
	assert_string_equal(next(b), "00180280#00000001");
	assert_string_equal(next(b), "00080280#00000001");
	assert_string_equal(next(b), "00780280#00000001");
	assert_string_equal(next(b), "");
	assert_int_equal(b->node.replies, 3);
}

static void reserved_registers_read_as_zero(void **state)
{
	struct bench *b = *state;

	hear(b, "0008039F#1301");
	assert_string_equal(next(b), "00080293#00000000");
	/* None behind the last. */
	hear(b, "0008039F#6001");
	assert_string_equal(next(b), "");
}

/* --- who it is for --------------------------------------------------------------------------------- */

static void other_frames_are_nothing(void **state)
{
	static const char *const others[] = {
		"0010039E#0003",             /* drive 2 */
		"09E#0003",                  /* standard */
		"00080200#0000000000000000", /* what drives say themselves */
		"00080280#00000001",
		"1008039E#0003",
		"123#",
	};
	struct bench *b = *state;

	for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
		hear(b, others[i]);
		assert_string_equal(next(b), "");
	}
	assert_int_equal(b->node.received, 0);
	assert_int_equal(refusals(b), 0);
	assert_false(status_of(b).status & VSMD_ST_HS);
}

static void a_broadcast_is_obeyed(void **state)
{
	struct bench *b = *state;

	hear(b, "00040382#");
	assert_int_equal(count(b, VSMD_OFF), 1);
	assert_int_equal(b->node.received, 1);
	assert_string_equal(b->node.log[0].line, "00040382#");
}

static void without_power_nothing_is_heard_or_said(void **state)
{
	struct bench *b = *state;

	hear(b, "0008039F#0001");
	sim_vsmd_power(b->node.drive, false, b->now);
	assert_string_equal(next(b), "");
	hear(b, "0008039F#0001");
	assert_string_equal(next(b), "");
	sim_vsmd_power(b->node.drive, true, b->now);
	assert_string_equal(next(b), "");
	hear(b, "0008039F#0001");
	assert_string_equal(next(b), "00080280#00000001");
}

/* --- commands -------------------------------------------------------------------------------------- */

static void every_command_and_no_acknowledgement(void **state)
{
	static const struct {
		const char *frame;
		enum vsmd_verb verb;
	} commands[] = {
		{ "00080381#", VSMD_ENA },
		{ "00080383#00000064", VSMD_ORG },
		{ "00080385#45480000", VSMD_MOV },
		{ "00080384#00", VSMD_STP },
		{ "00080384#01", VSMD_STP },
		{ "00080386#000061A8", VSMD_POS },
		{ "0008038B#FFFFFF9C45480000", VSMD_RMV },
		{ "00080384#01", VSMD_STP },
		{ "00080387#", VSMD_SAV },
		{ "0008038A#", VSMD_ZERO_STOP },
		{ "00080382#", VSMD_OFF },
	};
	struct bench *b = *state;

	for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
		uint32_t before = count(b, commands[i].verb);

		hear(b, commands[i].frame);
		assert_int_equal(count(b, commands[i].verb), before + 1);
		assert_string_equal(next(b), "");
		b->now += DB_NS_PER_S;
	}
	assert_int_equal(refusals(b), 0);
	assert_false(status_of(b).status & VSMD_ST_CMD_WRG);
	assert_true(status_of(b).status & VSMD_ST_HS);
}

static void a_move_goes_where_it_is_told(void **state)
{
	struct bench *b = *state;

	hear(b, "00080386#000001F445480000");
	assert_true(sim_motion_moving(&b->node.drive->motion));
	b->now += 60 * DB_NS_PER_S;
	hear(b, "0008038B#FFFFFFFF");
	b->now += 60 * DB_NS_PER_S;
	assert_int_equal(status_of(b).position, 499);
	assert_true(status_of(b).status & VSMD_ST_STP);
}

static void a_shake_takes_four_frames(void **state)
{
	struct bench *b = *state;

	hear(b, "0008039B#1000000000");
	hear(b, "0008039B#11000000C8");
	hear(b, "0008039B#123F800000");
	assert_int_equal(count(b, VSMD_SHAKE_CYCLES), 0);
	hear(b, "0008039B#0100000000");
	assert_int_equal(count(b, VSMD_SHAKE_CYCLES), 1);
	assert_true(sim_motion_moving(&b->node.drive->motion));
	hear(b, "0008039B#00");
	assert_int_equal(count(b, VSMD_SHAKE_STOP), 1);
	assert_int_equal(refusals(b), 0);
}

/* Read behind it, as hosts do. */
static void what_is_wrong_shows_in_the_status(void **state)
{
	static const char *const wrong[] = {
		"00080386#",             /* no position */
		"00080384#",             /* not what kind of stop */
		"00080388#0701",         /* seven outputs */
		"0008038C#",             /* reserved */
		"00080386#0000000047C4", /* half a speed */
	};
	struct bench *b = *state;

	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		hear(b, wrong[i]);
		assert_int_equal(refusals(b), i + 1);
		assert_true(status_of(b).status & VSMD_ST_CMD_WRG);
	}
	hear(b, "00080381#");
	assert_false(status_of(b).status & VSMD_ST_CMD_WRG);
}

/* --- writing --------------------------------------------------------------------------------------- */

/* The document prints the id of `off` for this. */
static void mcs_is_written_and_nothing_switched_off(void **state)
{
	struct bench *b = *state;

	hear(b, "00080302#00000004");
	assert_int_equal(b->node.drive->params[VSMD_MCS].u, 4);
	assert_int_equal(count(b, VSMD_OFF), 0);
	hear(b, "0008039F#0201");
	assert_string_equal(next(b), "00080282#00000004");
}

static void two_registers_in_one_frame(void **state)
{
	struct bench *b = *state;

	hear(b, "00080304#4640000046800000");
	assert_true(b->node.drive->params[VSMD_ACC].f == 12288.0f);
	assert_true(b->node.drive->params[VSMD_DEC].f == 16384.0f);
	hear(b, "0008039F#0402");
	assert_string_equal(next(b), "00080284#4640000046800000");
}

static void a_packed_register_holds_them_all(void **state)
{
	struct bench *b = *state;
	const union db_value *params = b->node.drive->params;

	hear(b, "00080309#03020004");
	assert_int_equal(params[VSMD_S1F].u, 3);
	assert_int_equal(params[VSMD_S1R].u, 2);
	assert_int_equal(params[VSMD_S2F].u, 0);
	assert_int_equal(params[VSMD_S2R].u, 4);
	hear(b, "0008039F#0901");
	assert_string_equal(next(b), "00080289#03020004");
}

static void writing_the_same_again_changes_nothing(void **state)
{
	struct bench *b = *state;
	uint32_t before;

	hear(b, "00080302#00000004");
	before = count(b, VSMD_CFG_WRITE);
	hear(b, "00080302#00000004");
	assert_int_equal(count(b, VSMD_CFG_WRITE), before);
	assert_int_equal(refusals(b), 0);
}

static void registers_that_cannot_be_written(void **state)
{
	struct bench *b = *state;

	hear(b, "00080302#000000FF"); /* no such micro-step */
	hear(b, "00080316#00000000"); /* reserved */
	hear(b, "00080302#0000");     /* half of one */
	assert_int_equal(refusals(b), 3);
	assert_true(status_of(b).status & VSMD_ST_CMD_WRG);
}

/* --- reports --------------------------------------------------------------------------------------- */

static void reports_come_at_their_interval(void **state)
{
	struct bench *b = *state;
	char text[TEXT_MAX];

	/* Position and status, every 20 ms, to host 3. */
	hear(b, "0008078F#020014");
	(void)snprintf(text, sizeof text, "00180201#00000000%08X", status_of(b).status);
	for (db_time i = 1; i <= 5; i++) {
		assert_int_equal(b->station.next(b->station.self), START + i * 20 * DB_NS_PER_MS);
		assert_string_equal(next(b), text);
	}
	hear(b, "0008078F#00");
	assert_string_equal(next(b), "");
}

static void reports_of_all_three_registers(void **state)
{
	struct bench *b = *state;

	/* Without an interval: that of the document. */
	hear(b, "0008038F#01");
	assert_int_equal(b->station.next(b->station.self), START + 50 * DB_NS_PER_MS);
	assert_string_equal(next(b), "00080200#0000000000000000");
	assert_memory_equal(next(b), "00080202#", 9);
	assert_int_equal(b->station.next(b->station.self), START + 100 * DB_NS_PER_MS);
}

static void an_answer_comes_between_reports(void **state)
{
	struct bench *b = *state;

	hear(b, "0008038F#03000A");
	hear(b, "0008039F#0001");
	assert_string_equal(next(b), "00080280#00000001");
	assert_string_equal(next(b), "00080201#00000000");
}

/* A host that is not there does not make the queue grow. */
static void what_nobody_fetches_is_lost(void **state)
{
	struct bench *b = *state;
	unsigned frames = 0;

	for (int i = 0; i < 2 * SIM_VSMD_CAN_QUEUE; i++)
		hear(b, "0008039F#0001");
	while (next(b)[0] != '\0')
		frames++;
	assert_int_equal(frames, SIM_VSMD_CAN_QUEUE);
}

/* --- standard frames ------------------------------------------------------------------------------- */

/* How drives answer in them is not documented: as if they were asked, in their own name. */
static void standard_frames(void **state)
{
	struct bench *b = *state;
	char text[TEXT_MAX];

	hear(b, "0FE#0003");
	assert_string_equal(next(b), "080#0000000000000000");
	(void)snprintf(text, sizeof text, "082#%08X", status_of(b).status);
	assert_string_equal(next(b), text);
	hear(b, "0E6#0000012C");
	assert_int_equal(count(b, VSMD_POS), 1);
	hear(b, "0C2#00000004");
	assert_int_equal(b->node.drive->params[VSMD_MCS].u, 4);
	hear(b, "0FF#0201");
	assert_string_equal(next(b), "0A2#00000004");
	/* To all; to another; of the other kind. */
	hear(b, "062#");
	assert_int_equal(count(b, VSMD_OFF), 1);
	hear(b, "162#");
	hear(b, "00080382#");
	assert_int_equal(count(b, VSMD_OFF), 1);
	assert_int_equal(refusals(b), 0);
}

#define CASE(function) cmocka_unit_test_setup_teardown(function, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		CASE(status_as_captured),
		CASE(data_as_captured),
		CASE(position_and_status_alone),
		CASE(identity_as_text),
		CASE(answers_come_in_order),
		CASE(reserved_registers_read_as_zero),
		CASE(other_frames_are_nothing),
		CASE(a_broadcast_is_obeyed),
		CASE(without_power_nothing_is_heard_or_said),
		CASE(every_command_and_no_acknowledgement),
		CASE(a_move_goes_where_it_is_told),
		CASE(a_shake_takes_four_frames),
		CASE(what_is_wrong_shows_in_the_status),
		CASE(mcs_is_written_and_nothing_switched_off),
		CASE(two_registers_in_one_frame),
		CASE(a_packed_register_holds_them_all),
		CASE(writing_the_same_again_changes_nothing),
		CASE(registers_that_cannot_be_written),
		CASE(reports_come_at_their_interval),
		CASE(reports_of_all_three_registers),
		CASE(an_answer_comes_between_reports),
		CASE(what_nobody_fetches_is_lost),
		cmocka_unit_test_setup_teardown(standard_frames, setup_standard, teardown),
	};

	return cmocka_run_group_tests_name("sim vsmd can node", tests, NULL, NULL);
}
