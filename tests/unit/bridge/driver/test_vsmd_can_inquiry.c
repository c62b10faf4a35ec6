/* SPDX-License-Identifier: Apache-2.0 */
/* What a scan asks VSMD drives on CAN, in bytes, and how it takes answers in the forms that drives have. */
#include "driver/list.h"
#include "driver/vsmd/can_device.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static struct vsmd_can_options extended = { .host_id = 1, .output_base = 1 };
static struct vsmd_can_options standard = { .frames = 1, .host_id = 1, .output_base = 1 };
static const struct db_bus_config bus = { .options = &extended };

/* The frames of an inquiry of drive 1, as text. */
static const char *ask(enum db_inquiry_kind kind, unsigned value)
{
	static char text[512];
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_exchange exchange = { .request = bytes, .request_size = sizeof bytes };
	const struct db_inquiry inquiry = { .kind = kind, .address = 1, .value = value };
	char *at = text;

	*at = '\0';
	assert_true(vsmd_can_inquire(&bus, &inquiry, &exchange));
	for (size_t i = 0; i < exchange.request_length; i += sizeof(struct db_can_frame)) {
		struct db_can_frame frame;

		memcpy(&frame, bytes + i, sizeof frame);
		at += sprintf(at, "%s%08X#", i > 0 ? " " : "",
		              (unsigned)(frame.id & DB_CAN_ID_MASK));
		for (unsigned j = 0; j < frame.length; j++)
			at += sprintf(at, "%02X", frame.data[j]);
	}
	return text;
}

struct talk {
	struct db_inquiry inquiry;
	struct db_inquired said;
};

static struct talk begin(enum db_inquiry_kind kind, unsigned value)
{
	return (struct talk){ .inquiry = { .kind = kind, .address = 1, .value = value } };
}

/* A frame from drive 1 to this host: `control` 0 status, 1 data. */
static enum db_recognised take(struct talk *talk, unsigned control, unsigned reg, uint32_t first,
                               uint32_t second, uint8_t length)
{
	struct db_can_frame frame = {
		.id = DB_CAN_EXTENDED | 1u << 19 | 1u << 9 | control << 7 | reg, .length = length
	};

	for (unsigned i = 0; i < 4; i++) {
		frame.data[i] = (uint8_t)(first >> (24 - 8 * i));
		frame.data[4 + i] = (uint8_t)(second >> (24 - 8 * i));
	}
	return vsmd_can_recognise(&bus, &talk->inquiry, (const uint8_t *)&frame, sizeof frame,
	                          &talk->said);
}

static void a_drive_is_asked_for_its_identity_or_its_data(void **state)
{
	struct talk talk;

	(void)state;
	assert_string_equal(ask(DB_INQUIRY_THERE, 0), "0008039E#0A01");
	assert_string_equal(ask(DB_INQUIRY_THERE, 1), "0008039F#0001");
	assert_string_equal(ask(DB_INQUIRY_THERE, 2), "0008039E#0A01");
	/* Alone or padded; what answers the other question is none. */
	for (uint8_t length = 4; length <= 8; length += 4) {
		talk = begin(DB_INQUIRY_THERE, 0);
		assert_int_equal(take(&talk, 1, 0x00, 1, 0, length), DB_RECOGNISED_NOTHING);
		assert_int_equal(take(&talk, 0, 0x0A, 0x56534D44, 0, length), DB_RECOGNISED_ANSWER);
		assert_int_equal(take(&talk, 0, 0x0A, 0x56534D44, 0, length), DB_RECOGNISED_AGAIN);
		talk = begin(DB_INQUIRY_THERE, 1);
		assert_int_equal(take(&talk, 0, 0x0A, 0x56534D44, 0, length),
		                 DB_RECOGNISED_NOTHING);
		assert_int_equal(take(&talk, 1, 0x00, 1, 0, length), DB_RECOGNISED_ANSWER);
	}
}

/* "VSMD113_025T" and zeros. */
static const uint32_t identity[VSMD_CAN_IDENTITY_REGS] = { 0x56534D44, 0x3131335F, 0x30323554 };

static void an_identity_comes_in_any_form(void **state)
{
	struct talk talk = begin(DB_INQUIRY_IDENTITY, 0);

	(void)state;
	assert_string_equal(ask(DB_INQUIRY_IDENTITY, 0), "0008039E#0A07");
	assert_string_equal(ask(DB_INQUIRY_IDENTITY, 1),
	                    "0008039E#0A02 0008039E#0C02 0008039E#0E02 0008039E#1001");
	/* Pairs, the last one alone or padded. */
	for (uint8_t length = 4; length <= 8; length += 4) {
		talk = begin(DB_INQUIRY_IDENTITY, 1);
		for (unsigned i = 0; i < 6; i += 2)
			assert_int_equal(take(&talk, 0, 0x0A + i, identity[i], identity[i + 1], 8),
			                 DB_RECOGNISED_PART);
		assert_int_equal(take(&talk, 0, 0x10, 0, 0xFFFFFFFF, length), DB_RECOGNISED_ANSWER);
		assert_string_equal(talk.said.identity, "VSMD113_025T");
	}
	/* One register a frame. */
	talk = begin(DB_INQUIRY_IDENTITY, 0);
	for (unsigned i = 0; i < 6; i++)
		assert_int_equal(take(&talk, 0, 0x0A + i, identity[i], 0, 4), DB_RECOGNISED_PART);
	assert_int_equal(take(&talk, 0, 0x0C, identity[2], 0, 4), DB_RECOGNISED_AGAIN);
	assert_int_equal(take(&talk, 0, 0x10, identity[6], 0, 4), DB_RECOGNISED_ANSWER);
	assert_string_equal(talk.said.identity, "VSMD113_025T");
	/* Beyond its end. */
	assert_int_equal(take(&talk, 0, 0x11, 0, 0, 4), DB_RECOGNISED_NOTHING);
}

static void whether_it_stands_and_what_it_is_told_may_be_padded(void **state)
{
	struct talk talk;

	(void)state;
	assert_string_equal(ask(DB_INQUIRY_STANDING, 0), "0008039E#0201");
	for (uint8_t length = 4; length <= 8; length += 4) {
		talk = begin(DB_INQUIRY_STANDING, 0);
		assert_int_equal(take(&talk, 0, 0x02, VSMD_ST_STP, 0, length),
		                 DB_RECOGNISED_ANSWER);
		assert_true(talk.said.tells_standing && talk.said.stands);
		talk = begin(DB_INQUIRY_SET_ADDRESS, 5);
		assert_int_equal(take(&talk, 1, 0x00, 5, 0, length), DB_RECOGNISED_ANSWER);
		assert_false(talk.said.refused);
		talk = begin(DB_INQUIRY_SET_ADDRESS, 5);
		assert_int_equal(take(&talk, 1, 0x00, 1, 5, length), DB_RECOGNISED_ANSWER);
		assert_true(talk.said.refused);
	}
	assert_string_equal(ask(DB_INQUIRY_SET_ADDRESS, 5), "00080300#00000005 0008039F#0001");
}

/* Its status says whether the flash took it. */
static void saving_is_refused_in_the_status(void **state)
{
	static const struct {
		uint32_t status;
		bool refused;
	} cases[] = { { VSMD_ST_STP | VSMD_ST_PWR, false },
		      { VSMD_ST_STP | VSMD_ST_CMD_WRG, true },
		      { VSMD_ST_STP | VSMD_ST_FLASH_ERR, true } };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct talk talk = begin(DB_INQUIRY_SAVE, 0);

		assert_int_equal(take(&talk, 0, 0x02, cases[i].status, 0, 4), DB_RECOGNISED_ANSWER);
		assert_int_equal(talk.said.refused, cases[i].refused);
		/* Nothing is told of a motion. */
		assert_false(talk.said.tells_standing);
	}
}

static bool can_ask(bool in_extended, enum db_inquiry_kind kind, unsigned address, unsigned value)
{
	const struct db_bus_config any = { .options = in_extended ? &extended : &standard };
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_exchange exchange = { .request = bytes, .request_size = sizeof bytes };
	const struct db_inquiry inquiry = { .kind = kind, .address = address, .value = value };

	return vsmd_can_inquire(&any, &inquiry, &exchange);
}

/* Addresses that a frame has no room for belong to another drive in it. */
static void no_drive_is_asked_for_another(void **state)
{
	(void)state;
	assert_false(can_ask(true, DB_INQUIRY_THERE, 0, 0));
	assert_true(can_ask(true, DB_INQUIRY_THERE, VSMD_CAN_DRIVE_MAX, 0));
	assert_false(can_ask(true, DB_INQUIRY_THERE, VSMD_CAN_DRIVE_MAX + 1, 0));
	assert_true(can_ask(false, DB_INQUIRY_THERE, VSMD_CAN_STD_DRIVE_MAX, 0));
	assert_false(can_ask(false, DB_INQUIRY_THERE, VSMD_CAN_STD_DRIVE_MAX + 1, 0));
	/* Nor is a drive given a number that none can have. */
	assert_true(can_ask(true, DB_INQUIRY_SET_ADDRESS, 1, 5));
	assert_false(can_ask(true, DB_INQUIRY_SET_ADDRESS, 1, 0));
	assert_false(can_ask(true, DB_INQUIRY_SET_ADDRESS, 1, VSMD_CAN_DRIVE_MAX + 1));
	/* Nor a speed. */
	assert_true(can_ask(true, DB_INQUIRY_SET_SPEED, 1, 500000));
	assert_false(can_ask(true, DB_INQUIRY_SET_SPEED, 1, 0));
	assert_true(can_ask(true, DB_INQUIRY_SAVE, 1, 0));
}

/* Nothing of an earlier exchange is left in one, and it says how long its answer takes. */
static void an_inquiry_is_a_whole_exchange(void **state)
{
	static const struct {
		enum db_inquiry_kind kind;
		size_t frames;
		size_t answer_length;
		db_time extra_time;
	} cases[] = {
		{ DB_INQUIRY_THERE, 1, 8 + 4, 0 },
		{ DB_INQUIRY_IDENTITY, 1, 4 * 8 + 7 * 4, 0 },
		{ DB_INQUIRY_STANDING, 1, 8 + 4, 0 },
		{ DB_INQUIRY_SET_ADDRESS, 2, 8 + 4, 0 },
		/* Writing the flash takes time. */
		{ DB_INQUIRY_SAVE, 2, 8 + 4, 1000 * DB_NS_PER_MS },
	};
	uint8_t bytes[DB_REQUEST_MAX];

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		const struct db_inquiry inquiry = { .kind = cases[i].kind,
			                            .address = 1,
			                            .value = 2 };
		const size_t length = cases[i].frames * sizeof(struct db_can_frame);
		struct db_exchange exchange = { .request = bytes,
			                        .request_size = length,
			                        .request_length = 16,
			                        .answer_length = 1,
			                        .extra_time = 7 };

		assert_true(vsmd_can_inquire(&bus, &inquiry, &exchange));
		assert_int_equal(exchange.request_length, length);
		assert_int_equal(exchange.answer_length, cases[i].answer_length);
		assert_true(exchange.extra_time == cases[i].extra_time);
		assert_true(exchange.repeatable);
		/* Half of it is none. */
		for (exchange.request_size = 0; exchange.request_size < length;
		     exchange.request_size++)
			assert_false(vsmd_can_inquire(&bus, &inquiry, &exchange));
	}
	assert_string_equal(ask(DB_INQUIRY_SAVE, 0), "00080387# 0008039E#0201");
	/* Every second time in parts. */
	assert_string_equal(ask(DB_INQUIRY_IDENTITY, 2), "0008039E#0A07");
	assert_string_equal(ask(DB_INQUIRY_IDENTITY, 3),
	                    "0008039E#0A02 0008039E#0C02 0008039E#0E02 0008039E#1001");
}

/* Whatever moves does not stand; bytes that are no text are no identity. */
static void an_answer_is_what_its_registers_say(void **state)
{
	struct talk talk = begin(DB_INQUIRY_STANDING, 0);

	(void)state;
	assert_int_equal(take(&talk, 0, 0x02, VSMD_ST_PWR, 0, 4), DB_RECOGNISED_ANSWER);
	assert_true(talk.said.tells_standing);
	assert_false(talk.said.stands);
	talk = begin(DB_INQUIRY_STANDING, 0);
	assert_int_equal(take(&talk, 0, 0x02, VSMD_ST_STP, 0, 4), DB_RECOGNISED_ANSWER);
	assert_true(talk.said.stands);
	talk = begin(DB_INQUIRY_IDENTITY, 0);
	strcpy(talk.said.identity, "before");
	for (unsigned i = 0; i < 6; i += 2)
		take(&talk, 0, 0x0A + i, 0x41424344, 0x41420744, 8);
	assert_int_equal(take(&talk, 0, 0x10, 0x41424344, 0, 4), DB_RECOGNISED_ANSWER);
	assert_string_equal(talk.said.identity, "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_is_asked_for_its_identity_or_its_data),
		cmocka_unit_test(an_identity_comes_in_any_form),
		cmocka_unit_test(saving_is_refused_in_the_status),
		cmocka_unit_test(no_drive_is_asked_for_another),
		cmocka_unit_test(whether_it_stands_and_what_it_is_told_may_be_padded),
		cmocka_unit_test(an_inquiry_is_a_whole_exchange),
		cmocka_unit_test(an_answer_is_what_its_registers_say),
	};

	return cmocka_run_group_tests_name("driver/vsmd_can_inquiry", tests, NULL, NULL);
}
