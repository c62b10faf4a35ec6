/* SPDX-License-Identifier: Apache-2.0 */
/* Frames that the documents print, in words. */
#include "codec/servo_can_describe.h"
#include "codec/vsmd_describe.h"
#include "codec/xyza_describe.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define NOBODY DB_DESCRIBED_NOBODY

static struct db_description description;

static void expect(int address, int axis, const char *words)
{
	assert_string_equal(description.text, words);
	assert_int_equal(description.address, address);
	assert_int_equal(description.axis, axis);
	assert_int_equal(description.length, strlen(words));
}

/* "5A A5 0A" as bytes; returns how many. */
static size_t read_hex(const char *text, uint8_t *bytes)
{
	size_t count = 0;

	for (char *end; *text; text = end)
		bytes[count++] = (uint8_t)strtoul(text, &end, 16);
	return count;
}

/* "043#0001000BB8", eight digits before the # for an extended id. */
static struct db_can_frame frame_of(const char *text)
{
	const char *at = strchr(text, '#');
	struct db_can_frame frame = { .id = (uint32_t)strtoul(text, NULL, 16) };

	if (at - text > 3)
		frame.id |= DB_CAN_EXTENDED;
	for (at++; at[0] != '\0'; at += 2) {
		char byte[3] = { at[0], at[1], '\0' };

		frame.data[frame.length++] = (uint8_t)strtoul(byte, NULL, 16);
	}
	return frame;
}

/* --- VSMD on serial lines ----------------------------------------------------------------------------- */

static void lines_of_vsmd(void **state)
{
	static const struct {
		const char *line;
		bool rs485;
		int address;
		const char *words;
	} lines[] = {
		{ "1 dev\n", true, 1, "identity?" },
		{ "\n1 dev\n", true, 1, "identity?" },
		{ "sts\n", false, NOBODY, "status?" },
		{ "0 off\n", true, DB_DESCRIBED_ALL, "disable" },
		{ "12 ena\n", true, 12, "enable" },
		{ "mov spd=6400\n", false, NOBODY, "turn at 6400 pulses/s" },
		{ "mov\n", false, NOBODY, "turn" },
		{ "2 pos 10000\n", true, 2, "move to 10000 pulses" },
		{ "pos 10000 spd=20000\n", false, NOBODY,
		  "move to 10000 pulses at 20000 pulses/s" },
		{ "rmv -6400\n", false, NOBODY, "move by -6400 pulses" },
		{ "stp\n", false, NOBODY, "stop" },
		{ "stp 0\n", false, NOBODY, "stop" },
		{ "stp 1\n", false, NOBODY, "stop at once" },
		{ "org\n", false, NOBODY, "the position is 0 pulses" },
		{ "org 320\n", false, NOBODY, "the position is 320 pulses" },
		{ "s3 on\n", false, NOBODY, "output s3 on" },
		{ "zero start\n", false, NOBODY, "start homing" },
		{ "zero stop\n", false, NOBODY, "stop homing" },
		{ "1 cfg\n", true, 1, "parameters?" },
		{ "1 cfg spd=6400 cid=2\n", true, 1, "set spd 6400 pulses/s, cid 2" },
		{ "sav\n", false, NOBODY, "save parameters" },
		{ "1 nonsense\n", true, NOBODY, "" },
		{ "\n", true, NOBODY, "" },
		{ "", true, NOBODY, "" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(lines); i++) {
		vsmd_serial_describe_line((const uint8_t *)lines[i].line, strlen(lines[i].line),
		                          lines[i].rs485, &description);
		expect(lines[i].address, -1, lines[i].words);
	}
}

static void replies_of_vsmd(void **state)
{
	static const uint8_t status[] = { 0xFF, 0x01, 0x02, 0, 0, 0,    0,    0,    0,    0,   0,
		                          0,    0,    0,    0, 0, 0x23, 0x33, 0x00, 0x13, 0xFE };
	static const char identity[] = "\xFF\x01\x01"
				       "VSMD113_025T-1.0.008.170428"
				       "\x00\x31\xFE";

	(void)state;
	vsmd_serial_describe_reply(status, sizeof status, &description);
	expect(1, -1,
	       "position 0 pulses, velocity 0 pulses/s, status s1 s2 pos_reached spd_reached org stp hs");
	vsmd_serial_describe_reply((const uint8_t *)identity, sizeof identity - 1, &description);
	expect(1, -1, "identity \"VSMD113_025T-1.0.008.170428\"");
	/* With a wrong sum it says nothing. */
	vsmd_serial_describe_reply(status + 1, sizeof status - 1, &description);
	expect(NOBODY, -1, "");
}

/* --- VSMD on CAN -------------------------------------------------------------------------------------- */

static void frames_of_vsmd_on_can(void **state)
{
	static const struct vsmd_can_style style = { .extended = true,
		                                     .host = 3,
		                                     .output_base = 1 };
	static const struct {
		const char *frame;
		int address;
		const char *words;
	} frames[] = {
		{ "0008079E#0003", 1, "velocity, position and status?" },
		{ "0008079E#0102", 1, "position and status?" },
		{ "0008079E#0A07", 1, "identity?" },
		{ "0008079F#000B", 1, "parameters in registers 00 to 0A?" },
		{ "00040781#", DB_DESCRIBED_ALL, "enable" },
		{ "00080782#", 1, "disable" },
		{ "00080785#45C80000", 1, "turn at 6400 pulses/s" },
		{ "00080786#00002710", 1, "move to 10000 pulses" },
		{ "00080784#01", 1, "stop at once" },
		{ "00080784#00", 1, "stop" },
		{ "00080789#", 1, "start homing" },
		{ "00080503#45C80000", 1, "set spd 6400 pulses/s" },
		{ "00180200#45C8000000002710", 1, "velocity 6400 pulses/s, position 10000 pulses" },
		{ "00180202#000011B3", 1, "status s1 s2 pos_reached spd_reached org stp hs" },
		{ "0018020A#56534D4431313300", 1,
		  "identity, a part: \"VSMD\", identity, a part: \"113 \"" },
		{ "00180283#45C8000047BB8000", 1, "spd 6400 pulses/s, acc 96000 pulses/s^2" },
		{ "123#00", NOBODY, "" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(frames); i++) {
		struct db_can_frame frame = frame_of(frames[i].frame);

		vsmd_can_describe(&style, &frame, &description);
		expect(frames[i].address, -1, frames[i].words);
	}
}

/* --- servo drives ------------------------------------------------------------------------------------- */

static void frames_of_servo_drives(void **state)
{
	static const struct servo_can_layout layout = {
		.ack_base = SERVO_CAN_BASE_ACK,
		.words = { .set = true,
		           .base = 0x0A0,
		           .length = 6,
		           .word0 = 4,
		           .word1 = 0,
		           .ack = 0x07,
		           .fixed = { 0, 0, 0x5C, 0xC5 } },
	};
	static const struct {
		enum servo_can_side from;
		const char *frame;
		int address;
		const char *words;
	} frames[] = {
		{ SERVO_CAN_FROM_HOST, "01F#", DB_DESCRIBED_ALL, "sync" },
		{ SERVO_CAN_FROM_HOST, "021#000A", 1, "enable" },
		{ SERVO_CAN_FROM_HOST, "03F#0001", 31, "disable" },
		{ SERVO_CAN_FROM_HOST, "020#000A", DB_DESCRIBED_ALL, "enable" },
		{ SERVO_CAN_FROM_HOST, "043#0000000000", 3, "mode position" },
		{ SERVO_CAN_FROM_HOST, "043#0001010BB8", 3, "mode speed, at most 3000 rpm" },
		{ SERVO_CAN_FROM_HOST, "061#01FC18", 1, "speed -1000 rpm" },
		{ SERVO_CAN_FROM_HOST, "061#020019", 1, "current 2.5 A" },
		{ SERVO_CAN_FROM_HOST, "09F#FFFFFFFE", 31, "internal position 0 is -2 counts" },
		{ SERVO_CAN_FROM_HOST, "0E1#00000000", 1, "the position is 0 counts" },
		{ SERVO_CAN_FROM_HOST, "101#0000138812345678", 1,
		  "acceleration 5000 rpm/s, deceleration 305419896 rpm/s" },
		{ SERVO_CAN_FROM_HOST, "0A0#00005CC50008", DB_DESCRIBED_ALL,
		  "command words ctrg, none" },
		{ SERVO_CAN_FROM_DRIVE, "002#01", 1, "acknowledges enable" },
		{ SERVO_CAN_FROM_DRIVE, "002#04FC18", 1, "acknowledges speed, measured -1000 rpm" },
		{ SERVO_CAN_FROM_DRIVE, "002#050019", 1, "acknowledges current, measured 2.5 A" },
		{ SERVO_CAN_FROM_DRIVE, "002#08AABB", 1, "acknowledges 08" },
		{ SERVO_CAN_FROM_DRIVE, "161#FFFE7960", 1, "position -100000 counts" },
		{ SERVO_CAN_FROM_DRIVE, "181#FA240021", 1, "speed -1500 rpm, current 3.3 A" },
		{ SERVO_CAN_FROM_DRIVE, "1A1#00050103", 1,
		  "status servo_started zero_speed, inputs 01, outputs 03" },
		{ SERVO_CAN_FROM_DRIVE, "201#0123FF859001", 1,
		  "supply voltage raw 291, temperature raw 65413, faults undervoltage overvoltage locked" },
		{ SERVO_CAN_FROM_DRIVE, "221#ABCD", 1, "analogue input 1 is 43981" },
		{ SERVO_CAN_FROM_DRIVE, "161#FFFE", NOBODY, "" },
		{ SERVO_CAN_FROM_DRIVE, "7FF#00", NOBODY, "" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(frames); i++) {
		struct db_can_frame frame = frame_of(frames[i].frame);

		servo_can_describe(&frame, &layout, frames[i].from, &description);
		expect(frames[i].address, -1, frames[i].words);
	}
}

/* --- XYZA --------------------------------------------------------------------------------------------- */

static void frames_of_xyza(void **state)
{
	static const struct {
		bool sent;
		const char *frame;
		int axis;
		const char *words;
	} frames[] = {
		{ true, "5A A5 0A AC 01 03 AC AC 08", -1, "are you there?" },
		{ true, "5A A5 0A F1 01 03 E1 A1 77", 0, "position without its sign?" },
		{ true, "5A A5 0A F1 01 03 E3 A3 7B", 0, "lead?" },
		{ true, "5A A5 0A F1 01 03 E4 A1 7A", -1, "inputs and outputs?" },
		{ true, "5A A5 0A F1 01 03 E5 C2 9C", -1, "start_key, stop_key, pause_key?" },
		{ true, "5A A5 0A F3 01 03 03 A1 9B", 0, "jog forward" },
		{ true, "5A A5 0A F4 01 03 02 00 FA", -1, "pause the program" },
		{ true, "5A A5 0B F1 01 03 E1 A1 0C 10 00 00 93", 0,
		  "the position without its sign is 4108 pulses" },
		{ true, "5A A5 0B F1 01 03 E1 A2 01 00 00 00 79", 0, "the position is negative" },
		{ true, "5A A5 0B F1 01 03 E2 A1 40 01 00 00 B9", 0, "set min_speed 320 Hz" },
		{ true, "5A A5 0B F1 01 03 E4 00 22 00 00 00 FB", -1, "output P2 on" },
		{ true, "5A A5 0B F1 01 03 E4 00 90 00 00 00 69", -1, "all outputs off" },
		{ true, "5A A5 0B F1 01 03 E5 C2 06 07 08 00 B1", -1,
		  "set start_key 6, stop_key 7, pause_key 8" },
		{ false, "5A A5 0C AA 00 03 00 AC 59", -1, "I am here" },
		{ false, "5A A5 0C AA 00 03 00 F3 A0", -1, "manual command accepted" },
		{ false, "5A A5 0C AB 00 03 00 F1 9F", -1, "read or write refused" },
		{ false, "5A A5 0B F1 00 03 E1 A1 01 01 00 00 78", 0,
		  "position without its sign 257 pulses" },
		{ false, "5A A5 0B F1 00 03 E1 A2 01 00 00 00 78", 0, "the position is negative" },
		{ false, "5A A5 0B F1 00 03 E1 A4 01 00 00 00 7A", 0, "it stands" },
		{ false, "5A A5 0B F1 00 03 E2 A1 C8 00 00 00 3F", 0, "min_speed 200 Hz" },
		{ false, "5A A5 0B F1 00 03 E4 C1 01 00 03 00 9D", -1,
		  "inputs 0001, outputs 0003" },
		{ false, "5A A5 0B F4 00 03 02 02 08 01 00 00 04", -1,
		  "program 2 waiting, instruction 264" },
	};
	uint8_t bytes[32];

	(void)state;
	for (size_t i = 0; i < COUNT(frames); i++) {
		xyza_describe(bytes, read_hex(frames[i].frame, bytes), frames[i].sent,
		              &description);
		expect(3, frames[i].axis, frames[i].words);
		assert_false(description.secret);
	}
}

static void a_password_is_not_told(void **state)
{
	static const char *const frames[] = {
		"5A A5 0B F1 00 03 E5 C6 04 03 02 01 A9",
		"5A A5 0B F1 00 03 E5 C5 04 03 02 01 A8",
		/* Damaged on its way. */
		"5A A5 0B F1 00 03 E5 C6 04 03 02 01 00",
	};
	uint8_t bytes[32];

	(void)state;
	for (size_t i = 0; i < COUNT(frames); i++) {
		xyza_describe(bytes, read_hex(frames[i], bytes), false, &description);
		assert_true(description.secret);
		assert_null(strpbrk(description.text, "0123456789"));
	}
	xyza_describe(bytes, read_hex("5A A5 0B F1 01 03 E5 C6 04 03 02 01 AA", bytes), true,
	              &description);
	expect(3, -1, "set password");
	assert_true(description.secret);
}

static void what_does_not_fit_is_left_out(void **state)
{
	(void)state;
	db_description_begin(&description);
	for (int i = 0; i < 1000; i++)
		db_description_add(&description, "%s", "0123456789");
	assert_int_equal(description.length, DB_DESCRIPTION_MAX - 1);
	assert_int_equal(strlen(description.text), DB_DESCRIPTION_MAX - 1);
}

/* What no page shows, as the user says it is. */
static void described_frames_of_servo_drives(void **state)
{
	static const struct servo_can_layout layout = {
		.ack_base = SERVO_CAN_BASE_ACK,
		.word1 = { .set = true, .base = 0x0C0, .length = 2, .size = 2, .ack = 8 },
		.move = { .set = true, .base = 0x120, .length = 4, .size = 4, .ack = 3 },
		.slot = 5,
		.slot_base = 0x240,
		.slot_ack = 11,
	};
	static const struct {
		const char *frame;
		const char *text;
	} frames[] = {
		{ "0C1#8001", "command word 1 bit 0 bit 15" },
		{ "121#FFFFFFFE", "move, target -2 steps" },
		{ "241#FFFFFFFE", "internal position 5 is -2 counts" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(frames); i++) {
		struct db_can_frame frame = frame_of(frames[i].frame);

		servo_can_describe(&frame, &layout, SERVO_CAN_FROM_HOST, &description);
		expect(1, -1, frames[i].text);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(lines_of_vsmd),
		cmocka_unit_test(replies_of_vsmd),
		cmocka_unit_test(frames_of_vsmd_on_can),
		cmocka_unit_test(frames_of_servo_drives),
		cmocka_unit_test(described_frames_of_servo_drives),
		cmocka_unit_test(frames_of_xyza),
		cmocka_unit_test(a_password_is_not_told),
		cmocka_unit_test(what_does_not_fit_is_left_out),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
