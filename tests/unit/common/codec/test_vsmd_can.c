/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_can.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <math.h>
#include <string.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define EXT DB_CAN_EXTENDED

/* The printed ids are those of a host whose id is 0. */
static const struct vsmd_can_style extended = { .extended = true, .host = 0, .output_base = 1 };
static const struct vsmd_can_style standard = { .extended = false, .output_base = 1 };

/* --- helpers -------------------------------------------------------------------------------------- */

static struct db_can_frame frame_of(uint32_t id, const char *hex)
{
	struct db_can_frame frame = { .id = id };
	static const char digits[] = "0123456789ABCDEF";

	for (; *hex != '\0'; hex++) {
		const char *digit = strchr(digits, *hex);

		if (*hex == ' ')
			continue;
		assert_non_null(digit);
		frame.data[frame.length / 2] = (uint8_t)(frame.data[frame.length / 2] << 4 |
		                                         (digit - digits));
		frame.length++;
	}
	frame.length /= 2;
	return frame;
}

static void assert_frame(const struct db_can_frame *frame, uint32_t id, const char *hex)
{
	struct db_can_frame expected = frame_of(id, hex);

	if (frame->id != expected.id)
		fail_msg("id %08X instead of %08X", (unsigned)frame->id, (unsigned)expected.id);
	assert_int_equal(frame->length, expected.length);
	assert_memory_equal(frame->data, expected.data, sizeof expected.data);
	assert_memory_equal(frame, &expected, sizeof expected);
}

static void assert_same_command(const struct vsmd_can_command *a, const struct vsmd_can_command *b)
{
	assert_int_equal(a->code, b->code);
	assert_int_equal(a->has_position, b->has_position);
	assert_int_equal(a->has_velocity, b->has_velocity);
	assert_int_equal(a->has_interval, b->has_interval);
	assert_int_equal(a->position, b->position);
	assert_true(a->velocity == b->velocity);
	assert_int_equal(a->port, b->port);
	assert_int_equal(a->value, b->value);
	assert_int_equal(a->shake, b->shake);
	assert_true(a->shake_frequency == b->shake_frequency);
	assert_int_equal(a->shake_count, b->shake_count);
	assert_int_equal(a->report, b->report);
	assert_int_equal(a->interval, b->interval);
	assert_int_equal(a->first, b->first);
	assert_int_equal(a->count, b->count);
}

/* One command in both kinds of frames, from the host and back on the drive's side. */
static void check_command(unsigned drive, struct vsmd_can_command command, uint32_t std_id,
                          uint32_t ext_id, const char *hex)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	assert_int_equal(vsmd_can_encode_command(&standard, drive, &command, &frame), VSMD_OK);
	assert_frame(&frame, std_id, hex);
	assert_int_equal(vsmd_can_decode(&standard, &frame, &message), VSMD_OK);
	assert_false(message.id.extended);
	assert_int_equal(message.id.target, drive);
	assert_same_command(&message.command, &command);

	assert_int_equal(vsmd_can_encode_command(&extended, drive, &command, &frame), VSMD_OK);
	assert_frame(&frame, EXT | ext_id, hex);
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_OK);
	assert_true(message.id.extended);
	assert_int_equal(message.id.target, drive);
	assert_int_equal(message.id.source, 0);
	assert_int_equal(message.id.control, VSMD_CAN_COMMAND);
	assert_same_command(&message.command, &command);
}

static void assert_refused(struct vsmd_can_command command, enum vsmd_error error)
{
	struct db_can_frame frame = frame_of(0x123, "55");

	assert_int_equal(vsmd_can_encode_command(&extended, 1, &command, &frame), error);
	assert_frame(&frame, 0x123, "55");
}

static void assert_undecoded(uint32_t id, const char *hex, enum vsmd_error error)
{
	struct db_can_frame frame = frame_of(id, hex);
	struct vsmd_can_message message;

	if (vsmd_can_decode(&extended, &frame, &message) != error)
		fail_msg("%08X#%s was not answered with %d", (unsigned)id, hex, (int)error);
}

/* --- ids ------------------------------------------------------------------------------------------ */

static void test_ids(void **state)
{
	static const struct {
		uint32_t packed;
		struct vsmd_can_id id;
	} rows[] = {
		/* the limits of every field */
		{ 0x000007FF, { false, false, VSMD_CAN_COMMAND, 15, 0, 31 } },
		{ 0x00000060, { false, true, VSMD_CAN_COMMAND, 0, 0, 0 } },
		{ 0x00000043, { false, true, VSMD_CAN_DATA_WRITE, 0, 0, 3 } },
		{ 0x00000080, { false, false, VSMD_CAN_STATUS_REPLY, 0, 1, 0 } },
		{ 0x000007BF, { false, false, VSMD_CAN_DATA_REPLY, 0, 15, 31 } },
		{ EXT | 0x0373FFFF, { true, false, VSMD_CAN_COMMAND, 110, 511, 127 } },
		{ EXT | 0x00080100, { true, false, VSMD_CAN_DATA_WRITE, 1, 0, 0 } },
		{ EXT | 0x00040381, { true, true, VSMD_CAN_COMMAND, 0, 1, 1 } },
		{ EXT | 0x0FF8DC00, { true, false, VSMD_CAN_STATUS_REPLY, 511, 110, 0 } },
		{ EXT | 0x000002FF, { true, false, VSMD_CAN_DATA_REPLY, 0, 1, 127 } },
		/* captured: host 3 asks drive 1 */
		{ EXT | 0x0008079E, { true, false, VSMD_CAN_COMMAND, 1, 3, 0x1E } },
		{ EXT | 0x00180200, { true, false, VSMD_CAN_STATUS_REPLY, 3, 1, 0 } },
		{ EXT | 0x00180202, { true, false, VSMD_CAN_STATUS_REPLY, 3, 1, 2 } },
		{ EXT | 0x00180280, { true, false, VSMD_CAN_DATA_REPLY, 3, 1, 0 } },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct vsmd_can_id id;
		uint32_t packed;

		assert_int_equal(vsmd_can_pack_id(&rows[i].id, &packed), VSMD_OK);
		assert_int_equal(packed, rows[i].packed);
		assert_int_equal(vsmd_can_unpack_id(packed, &id), VSMD_OK);
		assert_int_equal(id.extended, rows[i].id.extended);
		assert_int_equal(id.broadcast, rows[i].id.broadcast);
		assert_int_equal(id.control, rows[i].id.control);
		assert_int_equal(id.target, rows[i].id.target);
		assert_int_equal(id.source, rows[i].id.source);
		assert_int_equal(id.reg, rows[i].id.reg);
	}
}

static void test_impossible_ids_are_not_packed(void **state)
{
	static const struct vsmd_can_id ids[] = {
		{ false, false, VSMD_CAN_COMMAND, 16, 0, 1 },
		{ false, false, VSMD_CAN_COMMAND, 0, 0, 1 },
		{ false, false, VSMD_CAN_COMMAND, 1, 1, 1 }, /* no room for a source */
		{ false, false, VSMD_CAN_DATA_WRITE, 1, 0, 32 },
		{ false, true, VSMD_CAN_COMMAND, 1, 0, 1 },
		{ false, false, VSMD_CAN_STATUS_REPLY, 1, 1, 1 },
		{ false, false, VSMD_CAN_STATUS_REPLY, 0, 0, 1 },
		{ false, true, VSMD_CAN_STATUS_REPLY, 0, 1, 1 },
		{ true, false, VSMD_CAN_COMMAND, 111, 1, 1 },
		{ true, false, VSMD_CAN_COMMAND, 0, 1, 1 },
		{ true, false, VSMD_CAN_COMMAND, 1, 512, 1 },
		{ true, false, VSMD_CAN_COMMAND, 1, 1, 128 },
		{ true, true, VSMD_CAN_COMMAND, 5, 1, 1 },
		{ true, false, VSMD_CAN_DATA_REPLY, 1, 0, 1 },
		{ true, false, VSMD_CAN_DATA_REPLY, 1, 111, 1 },
		{ true, false, VSMD_CAN_DATA_REPLY, 512, 1, 1 },
		{ true, false, (enum vsmd_can_control)4, 1, 1, 1 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(ids); i++) {
		uint32_t packed = 77;

		if (vsmd_can_pack_id(&ids[i], &packed) != VSMD_ERR_RANGE)
			fail_msg("row %zu was packed", i);
		assert_int_equal(packed, 77);
	}
}

static void test_foreign_ids_are_not_unpacked(void **state)
{
	static const uint32_t ids[] = {
		EXT | 0x10080181,              /* the top bit is always 0 */
		EXT | 0x00000181,              /* drive 0 without the broadcast bit */
		EXT | 0x03780181,              /* drive 111 */
		EXT | 0x00180000,              /* a reply of drive 0 */
		EXT | 0x0018DE00,              /* a reply of drive 111 */
		EXT | 0x001C0200,              /* a reply to everybody */
		EXT | DB_CAN_REMOTE | 0x80181, /* the rest are no data frames */
		DB_CAN_REMOTE | 0xE1,
		DB_CAN_ERROR | 0xE1,
		EXT | DB_CAN_ERROR | 0x80181,
		0x00000800, /* more than 11 bits */
		0x00000000, /* a reply of drive 0 */
		0x0000003F,
	};

	(void)state;
	for (size_t i = 0; i < COUNT(ids); i++) {
		struct vsmd_can_id id = { .reg = 99 };

		assert_undecoded(ids[i], "00000000", VSMD_ERR_SYNTAX);
		if (vsmd_can_unpack_id(ids[i], &id) != VSMD_ERR_SYNTAX)
			fail_msg("%08X was taken", (unsigned)ids[i]);
		assert_int_equal(id.reg, 99);
	}
}

/* The document's tool may leave a target in a broadcast; nobody else would be meant. */
static void test_broadcast_with_a_target(void **state)
{
	struct vsmd_can_id id;

	(void)state;
	assert_int_equal(vsmd_can_unpack_id(EXT | 0x002C0103, &id), VSMD_OK);
	assert_true(id.broadcast);
	assert_int_equal(id.target, 0);
	assert_int_equal(id.control, VSMD_CAN_DATA_WRITE);
	assert_int_equal(id.reg, 3);
}

static void test_filter(void **state)
{
	struct vsmd_can_style host3 = { .extended = true, .host = 3, .output_base = 1 };
	struct db_can_filter filter = vsmd_can_answer_filter(&host3);
	static const uint32_t passed[] = { EXT | 0x00180200, EXT | 0x00180202, EXT | 0x00180280 };
	static const uint32_t stopped[] = {
		EXT | 0x0008079E, /* our own request, sent by another */
		EXT | 0x00180381, /* a command to drive 3 */
		EXT | 0x00080200, /* to host 1 */
		EXT | 0x001C0200, /* broadcast */
		EXT | 0x10180200, EXT | DB_CAN_REMOTE | 0x00180200, 0x200, 0x080,
	};

	(void)state;
	for (size_t i = 0; i < COUNT(passed); i++) {
		struct db_can_frame frame = { .id = passed[i] };

		assert_true(db_can_filter_passes(&filter, 1, &frame));
	}
	for (size_t i = 0; i < COUNT(stopped); i++) {
		struct db_can_frame frame = { .id = stopped[i] };

		assert_false(db_can_filter_passes(&filter, 1, &frame));
	}
	/* With the error flag in its mask the kernel would take it for a filter of error frames. */
	assert_int_equal(filter.mask & DB_CAN_ERROR, 0);
}

/* --- commands ------------------------------------------------------------------------------------- */

/* Every id printed beside a command, sections 3.3 to 3.12, and 5.2.6 and 5.2.7. */
static void test_commands_without_arguments(void **state)
{
	(void)state;
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_ENA }, 0xE1, 0x80181, "");
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_OFF }, 0xE2, 0x80182, "");
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_ORG }, 0xE3, 0x80183, "");
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_MOV }, 0xE5, 0x80185, "");
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_SAV }, 0xE7, 0x80187, "");
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_ZERO_START }, 0xE9, 0x80189,
	              "");
	check_command(1, (struct vsmd_can_command){ .code = VSMD_CAN_ZERO_STOP }, 0xEA, 0x8018A,
	              "");
}

static void test_moves(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_ORG, .has_position = true };

	(void)state;
	command.position = -2;
	check_command(1, command, 0xE3, 0x80183, "FFFFFFFE");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_MOV, .has_velocity = true };
	command.velocity = -VSMD_SPEED_MAX;
	check_command(1, command, 0xE5, 0x80185, "C83B8000");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_POS, .position = 25000 };
	check_command(1, command, 0xE6, 0x80186, "000061A8");
	command.position = INT32_MIN;
	check_command(1, command, 0xE6, 0x80186, "80000000");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_POS, .position = 50000 };
	command.has_velocity = true;
	command.velocity = 32000;
	check_command(10, command, 0x566, 0x500186, "0000C350 46FA0000");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_RMV, .position = INT32_MAX };
	check_command(1, command, 0xEB, 0x8018B, "7FFFFFFF");
	command.has_velocity = true;
	command.velocity = VSMD_SPEED_MAX;
	check_command(1, command, 0xEB, 0x8018B, "7FFFFFFF 483B8000");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_STP };
	check_command(1, command, 0xE4, 0x80184, "00");
	command.value = 1;
	check_command(1, command, 0xE4, 0x80184, "01");
}

static void test_outputs(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_OUTPUT, .port = 1 };

	(void)state;
	check_command(1, command, 0xE8, 0x80188, "0100");
	command.port = 6;
	command.value = 1;
	check_command(1, command, 0xE8, 0x80188, "0601");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_SV, .port = 1, .value = 0xFF };
	check_command(1, command, 0xED, 0x8018D, "00FF");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_NMOS, .port = 3, .value = 0x80 };
	check_command(1, command, 0xEE, 0x8018E, "0280");
}

/* Older firmware counts the ports of `output` from 0; those of sv and nmos it always did. */
static void test_output_base(void **state)
{
	static const struct vsmd_can_style old = { .extended = true, .output_base = 0 };
	struct vsmd_can_command command = { .code = VSMD_CAN_OUTPUT, .port = 6, .value = 1 };
	static const uint8_t wrong[] = { 6, 7, 254, 255 };
	struct vsmd_can_style odd = extended;
	struct vsmd_can_message message;
	struct db_can_frame frame;

	(void)state;
	assert_int_equal(vsmd_can_encode_command(&old, 1, &command, &frame), VSMD_OK);
	assert_frame(&frame, EXT | 0x80188, "0501");
	assert_int_equal(vsmd_can_decode(&old, &frame, &message), VSMD_OK);
	assert_int_equal(message.command.port, 6);
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_OK);
	assert_int_equal(message.command.port, 5);
	frame.data[0] = 0;
	assert_int_equal(vsmd_can_decode(&old, &frame, &message), VSMD_OK);
	assert_int_equal(message.command.port, 1);
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_ERR_RANGE);
	for (size_t i = 0; i < COUNT(wrong); i++) {
		frame.data[0] = wrong[i];
		assert_int_equal(vsmd_can_decode(&old, &frame, &message), VSMD_ERR_RANGE);
	}
	command.code = VSMD_CAN_SV;
	command.port = 1;
	assert_int_equal(vsmd_can_encode_command(&old, 1, &command, &frame), VSMD_OK);
	assert_frame(&frame, EXT | 0x8018D, "0001");
	odd.output_base = 2;
	assert_int_equal(vsmd_can_encode_command(&odd, 1, &command, &frame), VSMD_ERR_RANGE);
}

static void test_shake(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_SHAKE };

	(void)state;
	check_command(1, command, 0xFB, 0x8019B, "00");
	command.shake = VSMD_CAN_SHAKE_CYCLES;
	check_command(1, command, 0xFB, 0x8019B, "01 00000000");
	command.shake_count = INT32_MAX;
	check_command(1, command, 0xFB, 0x8019B, "01 7FFFFFFF");
	command.shake = VSMD_CAN_SHAKE_TIME;
	command.shake_count = 60;
	check_command(1, command, 0xFB, 0x8019B, "02 0000003C");
	command.shake_count = 0;
	command.shake = VSMD_CAN_SHAKE_START_AT;
	command.position = -1000;
	check_command(1, command, 0xFB, 0x8019B, "10 FFFFFC18");
	command.shake = VSMD_CAN_SHAKE_END_AT;
	command.position = 1000;
	check_command(1, command, 0xFB, 0x8019B, "11 000003E8");
	command.position = 0;
	command.shake = VSMD_CAN_SHAKE_FREQUENCY;
	command.shake_frequency = 0.1f;
	check_command(1, command, 0xFB, 0x8019B, "12 3DCCCCCD");
	command.shake_frequency = 20.0f;
	check_command(1, command, 0xFB, 0x8019B, "12 41A00000");
}

static void test_other_commands(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_ENCODER };

	(void)state;
	check_command(1, command, 0xFD, 0x8019D, "00");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_AUTO_RES_STS };
	check_command(1, command, 0xEF, 0x8018F, "00");
	command.report = VSMD_CAN_REPORT_ALL;
	command.has_interval = true;
	command.interval = 500;
	check_command(1, command, 0xEF, 0x8018F, "01 01F4");
	command.report = VSMD_CAN_REPORT_POSITION;
	command.interval = UINT16_MAX;
	check_command(1, command, 0xEF, 0x8018F, "03 FFFF");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_READ_STATUS, .count = 3 };
	check_command(1, command, 0xFE, 0x8019E, "0003");
	check_command(8, command, 0x47E, 0x40019E, "0003");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_READ_DATA, .first = 3, .count = 4 };
	check_command(1, command, 0xFF, 0x8019F, "0304");
}

/* Captured: host 3 asks drive 1 for its status. */
static void test_host_id(void **state)
{
	struct vsmd_can_style host = { .extended = true, .host = 3, .output_base = 1 };
	struct vsmd_can_command command = { .code = VSMD_CAN_READ_STATUS, .count = 3 };
	struct db_can_frame frame;

	(void)state;
	assert_int_equal(vsmd_can_encode_command(&host, 1, &command, &frame), VSMD_OK);
	assert_frame(&frame, EXT | 0x0008079E, "0003");
	host.host = 15;
	assert_int_equal(vsmd_can_encode_command(&host, 1, &command, &frame), VSMD_OK);
	assert_frame(&frame, EXT | 0x00081F9E, "0003");
	host.host = 512;
	assert_int_equal(vsmd_can_encode_command(&host, 1, &command, &frame), VSMD_ERR_RANGE);
	/* Standard frames have no room for it. */
	host.extended = false;
	assert_int_equal(vsmd_can_encode_command(&host, 1, &command, &frame), VSMD_OK);
	assert_frame(&frame, 0xFE, "0003");
}

static void test_broadcast(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_STP, .value = 1 };
	struct vsmd_can_style host = { .extended = true, .host = 1, .output_base = 1 };
	struct vsmd_can_message message;
	struct db_can_frame frame;
	uint32_t raw = 6;

	(void)state;
	assert_int_equal(vsmd_can_encode_command(&host, VSMD_CAN_BROADCAST, &command, &frame),
	                 VSMD_OK);
	assert_frame(&frame, EXT | 0x00040384, "01");
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_OK);
	assert_true(message.id.broadcast);
	assert_int_equal(vsmd_can_encode_command(&standard, VSMD_CAN_BROADCAST, &command, &frame),
	                 VSMD_OK);
	assert_frame(&frame, 0x064, "01");
	assert_int_equal(vsmd_can_encode_write(&host, VSMD_CAN_BROADCAST, 2, &raw, 1, &frame),
	                 VSMD_OK);
	assert_frame(&frame, EXT | 0x00040302, "00000006");
	command = (struct vsmd_can_command){ .code = VSMD_CAN_READ_STATUS, .count = 3 };
	assert_int_equal(vsmd_can_encode_command(&host, VSMD_CAN_BROADCAST, &command, &frame),
	                 VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x0004039E, "0003", VSMD_ERR_SYNTAX);
	assert_undecoded(0x07F, "0003", VSMD_ERR_SYNTAX);
}

static void test_drives_out_of_reach(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_ENA };
	static const unsigned drives[] = { 111, 127, 511, 512, 65536, 65537, UINT32_MAX };
	struct db_can_frame frame;

	(void)state;
	assert_int_equal(vsmd_can_encode_command(&extended, 110, &command, &frame), VSMD_OK);
	assert_frame(&frame, EXT | 0x03700181, "");
	assert_int_equal(vsmd_can_encode_command(&standard, 15, &command, &frame), VSMD_OK);
	assert_frame(&frame, 0x7E1, "");
	assert_int_equal(vsmd_can_encode_command(&standard, 16, &command, &frame), VSMD_ERR_RANGE);
	for (size_t i = 0; i < COUNT(drives); i++)
		assert_int_equal(vsmd_can_encode_command(&extended, drives[i], &command, &frame),
		                 VSMD_ERR_RANGE);
}

static void test_arguments_out_of_range(void **state)
{
	static const float speeds[] = { 192000.02f, -192000.02f, INFINITY, -INFINITY, NAN };
	static const float frequencies[] = { 0.0f, 0.099f, 20.001f, -1.0f, NAN };
	struct vsmd_can_command command = { .has_velocity = true };

	(void)state;
	for (size_t i = 0; i < COUNT(speeds); i++) {
		command.velocity = speeds[i];
		command.code = VSMD_CAN_MOV;
		assert_refused(command, VSMD_ERR_RANGE);
		command.code = VSMD_CAN_POS;
		assert_refused(command, VSMD_ERR_RANGE);
		command.code = VSMD_CAN_RMV;
		assert_refused(command, VSMD_ERR_RANGE);
	}
	command = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE };
	command.shake = VSMD_CAN_SHAKE_FREQUENCY;
	for (size_t i = 0; i < COUNT(frequencies); i++) {
		command.shake_frequency = frequencies[i];
		assert_refused(command, VSMD_ERR_RANGE);
	}
	command.shake_count = (uint32_t)INT32_MAX + 1;
	command.shake = VSMD_CAN_SHAKE_CYCLES;
	assert_refused(command, VSMD_ERR_RANGE);
	command.shake = VSMD_CAN_SHAKE_TIME;
	assert_refused(command, VSMD_ERR_RANGE);
	command.shake_count = 0;
	command.shake = (enum vsmd_can_shake)0x03;
	assert_refused(command, VSMD_ERR_RANGE);
	command = (struct vsmd_can_command){ .code = VSMD_CAN_STP, .value = 2 };
	assert_refused(command, VSMD_ERR_RANGE);
	command = (struct vsmd_can_command){ .code = VSMD_CAN_AUTO_RES_STS };
	command.report = (enum vsmd_can_report)4;
	assert_refused(command, VSMD_ERR_RANGE);
}

static void test_ports_out_of_range(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_OUTPUT };

	(void)state;
	assert_refused(command, VSMD_ERR_RANGE);
	command.port = 7;
	assert_refused(command, VSMD_ERR_RANGE);
	command.port = 6;
	command.value = 2;
	assert_refused(command, VSMD_ERR_RANGE);
	command = (struct vsmd_can_command){ .code = VSMD_CAN_SV };
	assert_refused(command, VSMD_ERR_RANGE);
	command.port = 4;
	assert_refused(command, VSMD_ERR_RANGE);
	command.code = VSMD_CAN_NMOS;
	assert_refused(command, VSMD_ERR_RANGE);
}

static void test_reads_out_of_range(void **state)
{
	struct vsmd_can_command command = { .code = VSMD_CAN_READ_DATA };
	struct db_can_frame frame;

	(void)state;
	assert_refused(command, VSMD_ERR_RANGE); /* none */
	command.count = VSMD_CAN_READ_MAX + 1;
	assert_refused(command, VSMD_ERR_RANGE);
	command.first = 127;
	command.count = 2;
	assert_refused(command, VSMD_ERR_RANGE);
	command.first = 128;
	command.count = 1;
	assert_refused(command, VSMD_ERR_RANGE);
	command.first = 64;
	command.count = 64;
	assert_int_equal(vsmd_can_encode_command(&extended, 1, &command, &frame), VSMD_OK);
	/* Registers from 0x20 on are out of reach of standard frames. */
	command.first = 0x1F;
	command.count = 1;
	assert_int_equal(vsmd_can_encode_command(&standard, 1, &command, &frame), VSMD_OK);
	command.count = 2;
	assert_int_equal(vsmd_can_encode_command(&standard, 1, &command, &frame), VSMD_ERR_RANGE);
	command.first = 0x20;
	command.count = 1;
	assert_int_equal(vsmd_can_encode_command(&standard, 1, &command, &frame), VSMD_ERR_RANGE);
}

static void test_unknown_codes(void **state)
{
	static const uint8_t reserved[] = { 0x00, 0x0C, 0x10, 0x11, 0x12, 0x13, 0x14, 0x15,
		                            0x16, 0x17, 0x18, 0x19, 0x1A, 0x1C, 0x20, 0x7F };

	(void)state;
	for (size_t i = 0; i < COUNT(reserved); i++) {
		struct vsmd_can_command command = { .code = (enum vsmd_can_code)reserved[i] };

		assert_refused(command, VSMD_ERR_SYNTAX);
		assert_undecoded(EXT | 0x00080180 | reserved[i], "", VSMD_ERR_SYNTAX);
	}
	assert_refused((struct vsmd_can_command){ .code = (enum vsmd_can_code)0x101 },
	               VSMD_ERR_SYNTAX);
}

/* The lengths of every command, and of none other than these. */
static void test_command_lengths(void **state)
{
	static const struct {
		uint8_t code;
		uint8_t lengths; /* bit n: n bytes */
	} rows[] = {
		{ VSMD_CAN_ENA, 1 },         { VSMD_CAN_OFF, 1 },
		{ VSMD_CAN_ORG, 0x11 },      { VSMD_CAN_STP, 2 },
		{ VSMD_CAN_MOV, 0x11 },      { VSMD_CAN_POS, 0x10 }, /* and 8 */
		{ VSMD_CAN_SAV, 1 },         { VSMD_CAN_OUTPUT, 4 },
		{ VSMD_CAN_ZERO_START, 1 },  { VSMD_CAN_ZERO_STOP, 1 },
		{ VSMD_CAN_RMV, 0x10 },      { VSMD_CAN_SV, 4 },
		{ VSMD_CAN_NMOS, 4 },        { VSMD_CAN_AUTO_RES_STS, 0x0A },
		{ VSMD_CAN_SHAKE, 2 },       { VSMD_CAN_ENCODER, 2 },
		{ VSMD_CAN_READ_STATUS, 4 }, { VSMD_CAN_READ_DATA, 4 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		bool move = rows[i].code == VSMD_CAN_POS || rows[i].code == VSMD_CAN_RMV;

		for (uint8_t length = 0; length <= 8; length++) {
			struct db_can_frame frame = { .id = EXT | 0x80180 | rows[i].code };
			bool right = rows[i].lengths >> length & 1 || (move && length == 8);
			struct vsmd_can_message message;
			bool taken;

			frame.length = length;
			taken = vsmd_can_decode(&extended, &frame, &message) != VSMD_ERR_SYNTAX;
			if (taken != right)
				fail_msg("code %02X with %u bytes", rows[i].code, length);
		}
	}
	/* A stop takes no number, all else of shake needs one. */
	assert_undecoded(EXT | 0x8019B, "00 00000000", VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x8019B, "01", VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x8019B, "12 41A0", VSMD_ERR_SYNTAX);
}

static void test_arguments_a_drive_refuses(void **state)
{
	struct db_can_frame frame = frame_of(EXT | 0x80184, "02");
	struct vsmd_can_message message;

	(void)state;
	assert_undecoded(EXT | 0x80185, "483B8001", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x80185, "7FC00000", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x80188, "0701", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x80188, "0102", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8018D, "0300", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8018E, "FF00", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8018F, "04", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8019B, "01 80000000", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8019B, "13 00000000", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8019D, "01", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8019E, "0000", VSMD_ERR_RANGE);
	assert_undecoded(EXT | 0x8019F, "00FF", VSMD_ERR_RANGE);
	assert_undecoded(0xFF, "1F02", VSMD_ERR_RANGE);
	/* The drive must know that it was meant, to say that the command was wrong. */
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_ERR_RANGE);
	assert_int_equal(message.id.target, 1);
	assert_int_equal(message.id.reg, VSMD_CAN_STP);
	frame.length = 9;
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_ERR_SYNTAX);
}

/* --- register writes ------------------------------------------------------------------------------ */

static void check_write(unsigned drive, unsigned first, const uint32_t *values, unsigned count,
                        uint32_t std_id, uint32_t ext_id, const char *hex)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	assert_int_equal(vsmd_can_encode_write(&standard, drive, first, values, count, &frame),
	                 VSMD_OK);
	assert_frame(&frame, std_id, hex);
	assert_int_equal(vsmd_can_encode_write(&extended, drive, first, values, count, &frame),
	                 VSMD_OK);
	assert_frame(&frame, EXT | ext_id, hex);
	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_OK);
	assert_int_equal(message.id.control, VSMD_CAN_DATA_WRITE);
	assert_int_equal(message.id.target, drive);
	assert_int_equal(message.id.reg, first);
	assert_int_equal(message.count, count);
	assert_memory_equal(message.values, values, count * sizeof *values);
}

/* Sections 4.4.1 to 4.4.4 and 5.2.5. */
static void test_printed_writes(void **state)
{
	uint32_t raw[2] = { 0 };

	(void)state;
	/* The extended id is misprinted there as that of `off`. */
	assert_int_equal(vsmd_can_insert(VSMD_MCS, (union db_value){ .u = 6 }, &raw[0]), VSMD_OK);
	check_write(1, 0x02, raw, 1, 0xC2, 0x80102, "00000006");
	assert_int_equal(vsmd_can_insert(VSMD_SPD, (union db_value){ .f = 192000 }, &raw[0]),
	                 VSMD_OK);
	check_write(1, 0x03, raw, 1, 0xC3, 0x80103, "483B8000");
	raw[0] = 0x01020304;
	assert_int_equal(vsmd_can_insert(VSMD_S2R, (union db_value){ .u = 5 }, &raw[0]), VSMD_OK);
	check_write(1, 0x09, raw, 1, 0xC9, 0x80109, "01020305");
	assert_int_equal(vsmd_can_insert(VSMD_ACC, (union db_value){ .f = 10000 }, &raw[0]),
	                 VSMD_OK);
	assert_int_equal(vsmd_can_insert(VSMD_DEC, (union db_value){ .f = 20000 }, &raw[1]),
	                 VSMD_OK);
	check_write(1, 0x04, raw, 2, 0xC4, 0x80104, "461C4000 469C4000");
	assert_int_equal(vsmd_can_insert(VSMD_SPD, (union db_value){ .f = 19200 }, &raw[0]),
	                 VSMD_OK);
	check_write(5, 0x03, raw, 1, 0x2C3, 0x280103, "46960000");
}

/* No write to any register, in any kind of frame and from any host, is a command. */
static void test_no_write_is_a_command(void **state)
{
	(void)state;
	for (unsigned reg = 0; reg <= VSMD_CAN_DATA_LAST; reg++) {
		for (uint16_t host = 0; host <= VSMD_CAN_SOURCE_MAX; host++) {
			struct vsmd_can_style style = { true, host, 1 };
			uint32_t raw = reg == 1 ? 0x5A132 : reg == 0 || reg == 0x22 ? 1 : 0;
			enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
			struct db_can_frame frame;

			if (reg == 0x21)
				raw = 10;
			if (reg == 0x27 || reg == 0x28)
				raw = 0x3F000000; /* 0.5 */
			if (vsmd_can_params_of(reg, params) == 0)
				continue;
			assert_int_equal(vsmd_can_encode_write(&style, 1, reg, &raw, 1, &frame),
			                 VSMD_OK);
			assert_int_equal(frame.id >> 7 & 3, VSMD_CAN_DATA_WRITE);
			assert_int_not_equal(frame.id & 0x1FF, 0x182);
		}
	}
}

static void test_refused_writes(void **state)
{
	static const struct {
		unsigned reg;
		uint32_t raw;
		enum vsmd_error error;
	} rows[] = {
		{ 0x00, 0, VSMD_ERR_RANGE },
		{ 0x00, 111, VSMD_ERR_RANGE },
		{ 0x01, 0x12133, VSMD_ERR_RANGE },
		{ 0x01, 500000, VSMD_ERR_RANGE },
		{ 0x01, 0x12123, VSMD_ERR_RANGE }, /* 500 kbit/s too, but not the documented code */
		{ 0x02, 9, VSMD_ERR_RANGE },
		{ 0x02, 0x10006, VSMD_ERR_RANGE },
		{ 0x03, 0x483B8001, VSMD_ERR_RANGE },
		{ 0x03, 0x7FC00000, VSMD_ERR_RANGE },
		{ 0x13, 12345, VSMD_OK },
		{ 0x19, UINT32_MAX, VSMD_OK },
		{ 0x1B, 0, VSMD_OK },
		{ 0x16, 0, VSMD_ERR_NAME },
		{ 0x29, 0, VSMD_ERR_NAME },
		{ 0x2C, 0, VSMD_ERR_NAME },
		{ 0x7F, 0, VSMD_ERR_NAME },
		{ 0x80, 0, VSMD_ERR_RANGE },
		{ 0x109, 0, VSMD_ERR_RANGE },
		{ 0x09, 0xFFFFFFFF, VSMD_OK }, /* packed */
	};
	const uint32_t three[3] = { 0, 0, 0 };
	struct db_can_frame frame;

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		if (vsmd_can_encode_write(&extended, 1, rows[i].reg, &rows[i].raw, 1, &frame) !=
		    rows[i].error)
			fail_msg("register %02X", rows[i].reg);
	}
	assert_int_equal(vsmd_can_encode_write(&extended, 1, 0x15, three, 2, &frame),
	                 VSMD_ERR_NAME);
	assert_int_equal(vsmd_can_encode_write(&extended, 1, 0x0E, three, 0, &frame),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_encode_write(&extended, 1, 0x0E, three, 3, &frame),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_encode_write(&extended, 111, 0x0E, three, 1, &frame),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_encode_write(&standard, 16, 0x0E, three, 1, &frame),
	                 VSMD_ERR_RANGE);
	/* 0x20 is the first one standard frames do not reach. */
	assert_int_equal(vsmd_can_encode_write(&standard, 1, 0x1F, three, 1, &frame), VSMD_OK);
	assert_int_equal(vsmd_can_encode_write(&standard, 1, 0x1F, three, 2, &frame),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_encode_write(&standard, 1, 0x20, three, 1, &frame),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_encode_write(&extended, 1, 0x20, three, 1, &frame), VSMD_OK);
}

static void test_register_frames_of_odd_length(void **state)
{
	(void)state;
	assert_undecoded(EXT | 0x80103, "", VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x80103, "483B80", VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x80103, "483B800000", VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x00180200, "00000000 000000", VSMD_ERR_SYNTAX);
	assert_undecoded(EXT | 0x0018027F, "00000000", VSMD_OK);
	assert_undecoded(EXT | 0x0018027F, "00000000 00000000", VSMD_ERR_RANGE);
	assert_undecoded(0x09F, "00000000 00000000", VSMD_ERR_RANGE);
	assert_undecoded(0x09F, "00000000", VSMD_OK);
}

/* --- answers -------------------------------------------------------------------------------------- */

static const struct vsmd_can_style host3 = { .extended = true, .host = 3, .output_base = 1 };

static enum vsmd_can_took take(struct vsmd_can_answer *answer, uint32_t id, const char *hex)
{
	struct db_can_frame frame = frame_of(id, hex);
	struct vsmd_can_message message;

	assert_int_equal(vsmd_can_decode(&extended, &frame, &message), VSMD_OK);
	return vsmd_can_take(answer, &message);
}

/* Captured: speed and position, then status; and cid and bdr. */
static void test_captured_answers(void **state)
{
	struct vsmd_status status = { 1000.0f, -2, VSMD_ST_STP | VSMD_ST_PWR };
	const uint32_t settings[2] = { 1, 0x12132 };
	struct vsmd_can_answer answer;
	struct db_can_frame frames[2];
	uint32_t values[3];
	union db_value bdr;

	(void)state;
	vsmd_can_put_status(&status, values);
	assert_int_equal(
		vsmd_can_encode_answer(&host3, 1, VSMD_CAN_STATUS_REPLY, 0, values, 3, frames, 2),
		2);
	assert_frame(&frames[0], EXT | 0x00180200, "447A0000 FFFFFFFE");
	assert_frame(&frames[1], EXT | 0x00180202, "00002100");
	assert_int_equal(
		vsmd_can_encode_answer(&host3, 1, VSMD_CAN_DATA_REPLY, 0, settings, 2, frames, 1),
		1);
	assert_frame(&frames[0], EXT | 0x00180280, "0000000100012132");

	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_DATA_REPLY, 0, 2), VSMD_OK);
	assert_int_equal(take(&answer, EXT | 0x00180280, "0000000100012132"), VSMD_CAN_WHOLE);
	assert_int_equal(answer.values[0], 1);
	assert_int_equal(vsmd_can_extract(VSMD_BDR, answer.values[1], &bdr), VSMD_OK);
	assert_int_equal(bdr.u, 500000);
}

static void test_answers_in_any_order(void **state)
{
	struct vsmd_can_answer answer;
	struct vsmd_status status;

	(void)state;
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 0, 3), VSMD_OK);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00002100"), VSMD_CAN_PART);
	assert_int_equal(take(&answer, EXT | 0x00180202, "FFFFFFFF"), VSMD_CAN_REPEATED);
	assert_int_equal(take(&answer, EXT | 0x00180200, "447A0000 FFFFFFFE"), VSMD_CAN_WHOLE);
	assert_int_equal(take(&answer, EXT | 0x00180200, "00000000 00000000"), VSMD_CAN_REPEATED);
	vsmd_can_get_status(answer.values, &status);
	assert_true(status.velocity == 1000.0f);
	assert_int_equal(status.position, -2);
	assert_int_equal(status.status, VSMD_ST_STP | VSMD_ST_PWR);
}

static void test_foreign_frames(void **state)
{
	struct vsmd_can_answer answer;

	(void)state;
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 2, 3), VSMD_OK);
	assert_int_equal(take(&answer, EXT | 0x00180402, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00100202, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180282, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180201, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180203, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180200, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180205, "00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180206, "00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, 0x082, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00080702, "00000000 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(answer.seen, 0);
	assert_int_equal(take(&answer, EXT | 0x00180204, "00000001"), VSMD_CAN_PART);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000002 00000003"), VSMD_CAN_WHOLE);
	assert_int_equal(answer.values[0], 2);
	assert_int_equal(answer.values[2], 1);
}

/* Not documented, and known by frames that no report looks like. */
static void test_answers_of_other_forms(void **state)
{
	struct vsmd_can_answer answer;

	(void)state;
	/* A report of all comes in a pair and a single one: neither proves anything. */
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 1, 2), VSMD_OK);
	assert_int_equal(take(&answer, EXT | 0x00180201, "00000001"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000002"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000002 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(answer.forms, 0);
	/* One a frame. */
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 0, 3), VSMD_OK);
	assert_int_equal(take(&answer, EXT | 0x00180201, "00000002"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180200, "00000001"), VSMD_CAN_PART);
	assert_int_equal(answer.forms, VSMD_CAN_SINGLES);
	assert_int_equal(take(&answer, EXT | 0x00180201, "00000002"), VSMD_CAN_PART);
	assert_int_equal(take(&answer, EXT | 0x00180201, "00000009"), VSMD_CAN_REPEATED);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000003"), VSMD_CAN_WHOLE);
	assert_int_equal(answer.values[1], 2);
	/* Eight bytes always. */
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 10, 1),
	                 VSMD_OK);
	assert_int_equal(take(&answer, EXT | 0x0018020A, "00000001 00000000"), VSMD_CAN_WHOLE);
	assert_int_equal(answer.forms, VSMD_CAN_PADDED);
	assert_int_equal(answer.values[0], 1);
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 0, 3), VSMD_OK);
	answer.forms = VSMD_CAN_PADDED;
	assert_int_equal(take(&answer, EXT | 0x00180200, "00000001 00000002"), VSMD_CAN_PART);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000003 00000000"), VSMD_CAN_WHOLE);
	/* One a frame of eight bytes: the second is never taken for a register. */
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_STATUS_REPLY, 0, 3), VSMD_OK);
	answer.forms = VSMD_CAN_PADDED;
	assert_int_equal(take(&answer, EXT | 0x00180200, "00000001 00000000"), VSMD_CAN_PART);
	assert_int_equal(take(&answer, EXT | 0x00180201, "00000002 00000000"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, EXT | 0x00180202, "00000003 00000000"), VSMD_CAN_FOREIGN);
}

static void test_who_sent_a_frame_of_another_form(void **state)
{
	struct db_can_frame frame = { .id = EXT | 0x00180202 };

	(void)state;
	assert_int_equal(vsmd_can_suspect(&frame), 1);
	frame.id = EXT | 0x00000202; /* to another host */
	assert_int_equal(vsmd_can_suspect(&frame), 1);
	frame.id = EXT | 0x00040202; /* to all */
	assert_int_equal(vsmd_can_suspect(&frame), 1);
	frame.id = 0x082; /* in a standard frame */
	assert_int_equal(vsmd_can_suspect(&frame), 1);
	frame.id = 0x0E2; /* a command in one */
	assert_int_equal(vsmd_can_suspect(&frame), -1);
	frame.id = EXT | 0x00080381; /* from a host */
	assert_int_equal(vsmd_can_suspect(&frame), -1);
}

/* How drives answer in standard frames is not documented; their own number is what is there. */
static void test_standard_answers(void **state)
{
	const uint32_t values[3] = { 1, 2, 3 };
	struct vsmd_can_answer answer;
	struct db_can_frame frames[2];
	struct vsmd_can_message message;

	(void)state;
	assert_int_equal(vsmd_can_encode_answer(&standard, 15, VSMD_CAN_STATUS_REPLY, 0, values, 3,
	                                        frames, 2),
	                 2);
	assert_frame(&frames[0], 0x780, "00000001 00000002");
	assert_frame(&frames[1], 0x782, "00000003");
	assert_int_equal(vsmd_can_decode(&standard, &frames[0], &message), VSMD_OK);
	assert_int_equal(message.id.source, 15);
	assert_int_equal(message.id.target, 0);
	assert_int_equal(vsmd_can_expect(&answer, &standard, 15, VSMD_CAN_STATUS_REPLY, 0, 3),
	                 VSMD_OK);
	assert_int_equal(take(&answer, 0x700, "00000001 00000002"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, 0x780, "00000001 00000002"), VSMD_CAN_PART);
	assert_int_equal(take(&answer, 0x7A2, "00000003"), VSMD_CAN_FOREIGN);
	assert_int_equal(take(&answer, 0x782, "00000003"), VSMD_CAN_WHOLE);
}

/* Every size of answer, its frames last to first. */
static void test_answers_of_every_size(void **state)
{
	(void)state;
	for (unsigned count = 1; count <= VSMD_CAN_READ_MAX; count++) {
		struct db_can_frame frames[VSMD_CAN_READ_MAX / 2];
		uint32_t values[VSMD_CAN_READ_MAX];
		struct vsmd_can_answer answer;
		unsigned first = VSMD_CAN_REG_MAX + 1 - count;
		int sent;

		for (unsigned i = 0; i < count; i++)
			values[i] = 0x80000000u + first + i;
		assert_int_equal(
			vsmd_can_expect(&answer, &host3, 110, VSMD_CAN_DATA_REPLY, first, count),
			VSMD_OK);
		sent = vsmd_can_encode_answer(&host3, 110, VSMD_CAN_DATA_REPLY, first, values,
		                              count, frames, COUNT(frames));
		assert_int_equal(sent, (count + 1) / 2);
		assert_int_equal(vsmd_can_encode_answer(&host3, 110, VSMD_CAN_DATA_REPLY, first,
		                                        values, count, frames, (size_t)sent - 1),
		                 VSMD_ERR_SPACE);
		while (sent-- > 0) {
			struct vsmd_can_message message;

			assert_int_equal(vsmd_can_decode(&host3, &frames[sent], &message), VSMD_OK);
			assert_int_equal(vsmd_can_take(&answer, &message),
			                 sent == 0 ? VSMD_CAN_WHOLE : VSMD_CAN_PART);
		}
		assert_memory_equal(answer.values, values, count * sizeof values[0]);
	}
}

static void test_impossible_answers(void **state)
{
	struct vsmd_can_answer answer;
	struct db_can_frame frame;
	const uint32_t value = 0;

	(void)state;
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_COMMAND, 0, 1),
	                 VSMD_ERR_SYNTAX);
	assert_int_equal(vsmd_can_expect(&answer, &host3, 0, VSMD_CAN_DATA_REPLY, 0, 1),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_expect(&answer, &host3, 111, VSMD_CAN_DATA_REPLY, 0, 1),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_DATA_REPLY, 0, 0),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_expect(&answer, &host3, 1, VSMD_CAN_DATA_REPLY, 0, 65),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_expect(&answer, &standard, 1, VSMD_CAN_DATA_REPLY, 0x1F, 2),
	                 VSMD_ERR_RANGE);
	assert_int_equal(
		vsmd_can_encode_answer(&host3, 1, VSMD_CAN_DATA_WRITE, 0, &value, 1, &frame, 1),
		VSMD_ERR_RANGE);
	assert_int_equal(
		vsmd_can_encode_answer(&host3, 0, VSMD_CAN_DATA_REPLY, 0, &value, 1, &frame, 1),
		VSMD_ERR_RANGE);
	assert_int_equal(
		vsmd_can_encode_answer(&host3, 1, VSMD_CAN_DATA_REPLY, 0, &value, 0, &frame, 1),
		VSMD_ERR_RANGE);
}

/* --- status registers ----------------------------------------------------------------------------- */

static void test_identity(void **state)
{
	/* Section 2.5. */
	static const uint32_t printed[VSMD_CAN_IDENTITY_REGS] = {
		0x56534D44, 0x3130362D, 0x30323554, 0x2D312E30, 0x2E303430, 0x2E313731, 0x31303120,
	};
	uint32_t values[VSMD_CAN_IDENTITY_REGS];
	char text[VSMD_CAN_IDENTITY_MAX + 1];

	(void)state;
	assert_int_equal(vsmd_can_get_identity(printed, text), 27);
	assert_string_equal(text, "VSMD106-025T-1.0.040.171101");
	assert_int_equal(vsmd_can_put_identity(text, values), VSMD_OK);
	assert_memory_equal(values, printed, sizeof printed);
	memcpy(values, printed, sizeof values);
	values[6] = 0x31303100; /* ended by a NUL */
	assert_int_equal(vsmd_can_get_identity(values, text), 27);
	values[6] = 0x313031FF; /* by flash that was never written */
	assert_int_equal(vsmd_can_get_identity(values, text), 27);
	values[6] = 0x31303132; /* by nothing */
	assert_int_equal(vsmd_can_get_identity(values, text), 28);
	assert_string_equal(text, "VSMD106-025T-1.0.040.1711012");
	values[1] = 0x00FF01FF; /* what is behind a NUL does not count */
	assert_int_equal(vsmd_can_get_identity(values, text), 4);
	assert_string_equal(text, "VSMD");
	values[1] = 0x01203030;
	assert_int_equal(vsmd_can_get_identity(values, text), VSMD_ERR_SYNTAX);
	values[1] = 0x207E0000; /* the first and the last that can be printed */
	assert_int_equal(vsmd_can_get_identity(values, text), 6);
	assert_string_equal(text, "VSMD ~");
	assert_int_equal(vsmd_can_put_identity("VSMD ~", values), VSMD_OK);
	assert_int_equal(values[1], 0x207E2020);
	values[1] = 0x7F303030;
	assert_int_equal(vsmd_can_get_identity(values, text), VSMD_ERR_SYNTAX);
	memset(values, 0xFF, sizeof values);
	assert_int_equal(vsmd_can_get_identity(values, text), 0);
	assert_string_equal(text, "");
}

static void test_identities_that_do_not_fit(void **state)
{
	uint32_t values[VSMD_CAN_IDENTITY_REGS];

	(void)state;
	assert_int_equal(vsmd_can_put_identity("0123456789012345678901234567", values), VSMD_OK);
	assert_int_equal(vsmd_can_put_identity("01234567890123456789012345678", values),
	                 VSMD_ERR_SPACE);
	assert_int_equal(vsmd_can_put_identity("VSMD\n", values), VSMD_ERR_RANGE);
	assert_int_equal(vsmd_can_put_identity("", values), VSMD_OK);
	assert_int_equal(values[0], 0x20202020);
}

static void test_status_registers(void **state)
{
	static const struct vsmd_status statuses[] = {
		{ 0.0f, 0, 0 },
		{ -192000.0f, INT32_MIN, UINT32_MAX },
		{ 192000.0f, INT32_MAX, VSMD_ST_ACT },
	};
	static const uint32_t raw[][3] = {
		{ 0, 0, 0 },
		{ 0xC83B8000, 0x80000000, 0xFFFFFFFF },
		{ 0x483B8000, 0x7FFFFFFF, 0x08000000 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(statuses); i++) {
		struct vsmd_status status;
		uint32_t values[3];

		vsmd_can_put_status(&statuses[i], values);
		assert_memory_equal(values, raw[i], sizeof values);
		vsmd_can_get_status(values, &status);
		assert_true(status.velocity == statuses[i].velocity);
		assert_int_equal(status.position, statuses[i].position);
		assert_int_equal(status.status, statuses[i].status);
	}
}

/* --- data registers ------------------------------------------------------------------------------- */

/* The table of section 4.1 and the bytes and bits of 4.2: names from the highest field down. */
static const struct {
	uint8_t reg;
	const char *names[VSMD_CAN_FIELDS_MAX];
} layout[] = {
	{ 0x00, { "cid" } },
	{ 0x01, { "bdr" } },
	{ 0x02, { "mcs" } },
	{ 0x03, { "spd" } },
	{ 0x04, { "acc" } },
	{ 0x05, { "dec" } },
	{ 0x06, { "cra" } },
	{ 0x07, { "crn" } },
	{ 0x08, { "crh" } },
	{ 0x09, { "s1f", "s1r", "s2f", "s2r" } },
	{ 0x0A, { "s3f", "s3r", "s4f", "s4r" } },
	{ 0x0B, { "s5f", "s5r", "s6f", "s6r" } },
	{ 0x0C, { "pud" } },
	{ 0x0D, { "s6", "s5", "s4", "s3", "s2", "s1" } },
	{ 0x0E, { "zmd" } },
	{ 0x0F, { "osv" } },
	{ 0x10, { "snr" } },
	{ 0x11, { "zsd" } },
	{ 0x12, { "zsp" } },
	{ 0x13, { "dmd" } },
	{ 0x14, { "dar" } },
	{ 0x15, { "res" } },
	{ 0x16, { NULL } },
	{ 0x17, { "msr", "msv", "psr", "psv" } },
	{ 0x18, { "pae" } },
	{ 0x19, { "caf" } },
	{ 0x1A, { "zar" } },
	{ 0x1B, { "sds" } },
	{ 0x1C, { "zcr" } },
	{ 0x1D, { "n1ratio" } },
	{ 0x1E, { "n2ratio" } },
	{ 0x1F, { "n3ratio" } },
	{ 0x20, { "emod" } },
	{ 0x21, { "elns" } },
	{ 0x22, { "estp" } },
	{ 0x23, { "erty" } },
	{ 0x24, { "edir" } },
	{ 0x25, { "ez" } },
	{ 0x26, { "ewr" } },
	{ 0x27, { "eratio" } },
	{ 0x28, { "esds" } },
	{ 0x29, { NULL } },
	{ 0x2A, { "sml" } },
	{ 0x2B, { "spl" } },
	{ 0x2C, { NULL } },
	{ 0x7F, { NULL } },
};

static void test_layout(void **state)
{
	size_t total = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(layout); i++) {
		unsigned reg = layout[i].reg;
		enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
		size_t count = vsmd_can_params_of(reg, params);
		bool packed = (reg >= 0x09 && reg <= 0x0D) || reg == 0x17;

		for (size_t j = 0; j < count; j++) {
			assert_non_null(layout[i].names[j]);
			assert_string_equal(vsmd_params[params[j]].name, layout[i].names[j]);
			assert_int_equal(vsmd_can_fields[params[j]].reg, reg);
		}
		assert_true(count == VSMD_CAN_FIELDS_MAX || layout[i].names[count] == NULL);
		assert_int_equal(vsmd_can_reg_packed(reg), packed);
		assert_true(vsmd_can_reg_reachable(reg, true));
		assert_int_equal(vsmd_can_reg_reachable(reg, false), reg < 0x20);
		total += count;
	}
	assert_int_equal(total, VSMD_PARAM_COUNT);
	assert_false(vsmd_can_reg_reachable(0x80, true));
}

static void test_packed_fields(void **state)
{
	static const struct {
		const char *name;
		uint32_t before;
		uint32_t value;
		uint32_t after;
	} rows[] = {
		{ "s1f", 0x01020304, 9, 0x09020304 },
		{ "s1r", 0x01020304, 9, 0x01090304 },
		{ "s2f", 0x01020304, 9, 0x01020904 },
		{ "s2r", 0x01020304, 5, 0x01020305 },
		{ "s3f", 0xFFFFFFFF, 0, 0x00FFFFFF },
		{ "s3r", 0xFFFFFFFF, 0, 0xFF00FFFF },
		{ "s4f", 0xFFFFFFFF, 0, 0xFFFF00FF },
		{ "s4r", 0xFFFFFFFF, 0, 0xFFFFFF00 },
		{ "s5f", 0, 1, 0x01000000 },
		{ "s5r", 0, 2, 0x00020000 },
		{ "s6f", 0, 3, 0x00000300 },
		{ "s6r", 0, 4, 0x00000004 },
		{ "pud", 0x3F, 0x2A, 0x2A },
		{ "pud", 0xFFFFFF80, 0x01, 0xFFFFFF81 },
		{ "s1", 0, 1, 0x01 },
		{ "s2", 0, 1, 0x02 },
		{ "s3", 0x3F, 0, 0x3B },
		{ "s4", 0, 1, 0x08 },
		{ "s5", 0x3F, 0, 0x2F },
		{ "s6", 0xFFFFFF00, 1, 0xFFFFFF20 },
		{ "msr", 0x01010201, 6, 0x06010201 },
		{ "msv", 0x01010201, 0, 0x01000201 },
		{ "psr", 0x01010201, 0, 0x01010001 },
		{ "psv", 0x01010201, 0, 0x01010200 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		int param = vsmd_param_find(rows[i].name, strlen(rows[i].name));
		union db_value value = { .u = rows[i].value };
		uint32_t raw = rows[i].before;

		assert_true(param >= 0);
		assert_int_equal(vsmd_can_insert((enum vsmd_param)param, value, &raw), VSMD_OK);
		if (raw != rows[i].after)
			fail_msg("%s: %08X instead of %08X", rows[i].name, (unsigned)raw,
			         (unsigned)rows[i].after);
		value.u = 0xAAAAAAAA;
		assert_int_equal(vsmd_can_extract((enum vsmd_param)param, raw, &value), VSMD_OK);
		assert_int_equal(value.u, rows[i].value);
	}
}

/* The bounds of each parameter come back from its register; one beyond leaves the register alone. */
static void test_every_parameter(void **state)
{
	(void)state;
	for (unsigned i = 0; i < VSMD_PARAM_COUNT; i++) {
		enum vsmd_param param = (enum vsmd_param)i;
		const struct db_param *row = &vsmd_can_params[i];
		double ends[] = { row->min, row->max };

		if (param == VSMD_BDR)
			continue;
		if (param == VSMD_ERATIO)
			ends[0] = 1;
		for (size_t end = 0; end < COUNT(ends); end++) {
			union db_value value;
			union db_value back;
			uint32_t raw = 0;

			assert_true(db_value_from_number(row->type, ends[end], &value));
			assert_int_equal(vsmd_can_insert(param, value, &raw), VSMD_OK);
			assert_int_equal(vsmd_can_extract(param, raw, &back), VSMD_OK);
			assert_int_equal(back.u, value.u);
		}
		if ((row->type == DB_U16 || row->type == DB_U32) && row->max < UINT32_MAX) {
			union db_value beyond = { .u = (uint32_t)ends[1] + 1 };
			uint32_t raw = 0x12345678;

			assert_int_equal(vsmd_can_insert(param, beyond, &raw), VSMD_ERR_RANGE);
			assert_int_equal(raw, 0x12345678);
		} else if (row->type == DB_F32) {
			uint32_t raw = 0x12345678;

			assert_int_equal(vsmd_can_insert(param, (union db_value){ .f = NAN }, &raw),
			                 VSMD_ERR_RANGE);
			assert_int_equal(raw, 0x12345678);
		}
	}
}

static void test_values_only_the_drive_can_hold(void **state)
{
	union db_value value = { .u = 77 };

	(void)state;
	assert_int_equal(vsmd_can_extract(VSMD_MCS, 300, &value), VSMD_OK); /* out of range */
	assert_int_equal(value.u, 300);
	assert_int_equal(vsmd_can_extract(VSMD_ESTP, 65535, &value), VSMD_OK);
	assert_int_equal(vsmd_can_extract(VSMD_ESTP, 65536, &value), VSMD_ERR_RANGE);
	assert_int_equal(value.u, 65535);
	assert_int_equal(vsmd_can_extract(VSMD_BDR, 0, &value), VSMD_ERR_RANGE);
	assert_int_equal(value.u, 65535);
	assert_int_equal(vsmd_can_extract(VSMD_SML, 0x80000000, &value), VSMD_OK);
	assert_int_equal(value.i, INT32_MIN);
}

static void test_ranges_of_can(void **state)
{
	(void)state;
	assert_true(vsmd_can_param_in_range(VSMD_CID, (union db_value){ .u = 110 }));
	assert_false(vsmd_can_param_in_range(VSMD_CID, (union db_value){ .u = 111 }));
	assert_false(vsmd_can_param_in_range(VSMD_CID, (union db_value){ .u = 0 }));
	assert_true(vsmd_can_param_in_range(VSMD_BDR, (union db_value){ .u = 1000000 }));
	assert_false(vsmd_can_param_in_range(VSMD_BDR, (union db_value){ .u = 9600 }));
	assert_false(vsmd_can_param_in_range(VSMD_BDR, (union db_value){ .u = 0 }));
	assert_true(vsmd_can_param_in_range(VSMD_MCS, (union db_value){ .u = 8 }));
	assert_false(vsmd_can_param_in_range(VSMD_MCS, (union db_value){ .u = 9 }));
}

/* --- bit rates ------------------------------------------------------------------------------------ */

/* All rows of section 4.2.2, in kbit/s. */
static void test_bit_rates(void **state)
{
	static const struct {
		uint32_t code;
		uint32_t rate;
	} rows[] = {
		{ 0x1C2132, 20 }, { 0x168132, 25 }, { 0x12C132, 30 }, { 0xE1132, 40 },
		{ 0xB4132, 50 },  { 0x5A163, 60 },  { 0x78132, 75 },  { 0x4B153, 80 },
		{ 0x4B143, 90 },  { 0x5A132, 100 }, { 0x48132, 125 }, { 0x3C132, 150 },
		{ 0x2D132, 200 }, { 0x24132, 250 }, { 0x1E132, 300 }, { 0xF153, 400 },
		{ 0x12132, 500 }, { 0x9163, 600 },  { 0x8153, 750 },  { 0x6163, 900 },
		{ 0x9132, 1000 },
	};

	(void)state;
	assert_int_equal(COUNT(rows), 21);
	for (size_t i = 0; i < COUNT(rows); i++) {
		uint32_t rate = rows[i].rate * 1000;
		union db_value value = { .u = rate };
		uint32_t raw = 0xDEADBEEF;

		assert_int_equal(vsmd_can_code_rate(rows[i].code), rate);
		assert_int_equal(vsmd_can_rate_code(rate), rows[i].code);
		assert_int_equal(vsmd_can_insert(VSMD_BDR, value, &raw), VSMD_OK);
		assert_int_equal(raw, rows[i].code);
		assert_int_equal(vsmd_can_extract(VSMD_BDR, raw, &value), VSMD_OK);
		assert_int_equal(value.u, rate);
	}
	assert_int_equal(vsmd_can_rate_code(0), 0);
	assert_int_equal(vsmd_can_rate_code(500001), 0);
	assert_int_equal(vsmd_can_code_rate(0), 0);
	assert_int_equal(vsmd_can_code_rate(0xFFF), 0);
	assert_int_equal(vsmd_can_code_rate(0x1000), 54000000);
	assert_int_equal(vsmd_can_code_rate(0xFFFFFFFF), 2);
	assert_int_equal(vsmd_can_code_rate(0x12F32),
	                 500000); /* the jump width has no part in it */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_ids),
		cmocka_unit_test(test_impossible_ids_are_not_packed),
		cmocka_unit_test(test_foreign_ids_are_not_unpacked),
		cmocka_unit_test(test_broadcast_with_a_target),
		cmocka_unit_test(test_filter),
		cmocka_unit_test(test_commands_without_arguments),
		cmocka_unit_test(test_moves),
		cmocka_unit_test(test_outputs),
		cmocka_unit_test(test_output_base),
		cmocka_unit_test(test_shake),
		cmocka_unit_test(test_other_commands),
		cmocka_unit_test(test_host_id),
		cmocka_unit_test(test_broadcast),
		cmocka_unit_test(test_drives_out_of_reach),
		cmocka_unit_test(test_arguments_out_of_range),
		cmocka_unit_test(test_ports_out_of_range),
		cmocka_unit_test(test_reads_out_of_range),
		cmocka_unit_test(test_unknown_codes),
		cmocka_unit_test(test_command_lengths),
		cmocka_unit_test(test_arguments_a_drive_refuses),
		cmocka_unit_test(test_printed_writes),
		cmocka_unit_test(test_no_write_is_a_command),
		cmocka_unit_test(test_refused_writes),
		cmocka_unit_test(test_register_frames_of_odd_length),
		cmocka_unit_test(test_captured_answers),
		cmocka_unit_test(test_answers_in_any_order),
		cmocka_unit_test(test_foreign_frames),
		cmocka_unit_test(test_answers_of_other_forms),
		cmocka_unit_test(test_who_sent_a_frame_of_another_form),
		cmocka_unit_test(test_standard_answers),
		cmocka_unit_test(test_answers_of_every_size),
		cmocka_unit_test(test_impossible_answers),
		cmocka_unit_test(test_identity),
		cmocka_unit_test(test_identities_that_do_not_fit),
		cmocka_unit_test(test_status_registers),
		cmocka_unit_test(test_layout),
		cmocka_unit_test(test_packed_fields),
		cmocka_unit_test(test_every_parameter),
		cmocka_unit_test(test_values_only_the_drive_can_hold),
		cmocka_unit_test(test_ranges_of_can),
		cmocka_unit_test(test_bit_rates),
	};

	return cmocka_run_group_tests_name("vsmd_can", tests, NULL, NULL);
}
