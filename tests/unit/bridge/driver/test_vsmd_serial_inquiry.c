/* SPDX-License-Identifier: Apache-2.0 */
/* What a scan asks VSMD drives on serial lines, and which frames it takes for the answer. */
#include "codec/vsmd_serial_frames.h"
#include "driver/list.h"
#include "driver/vsmd/vsmd_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static const struct db_bus_config rs485 = { .driver = &db_driver_vsmd_serial,
	                                    .line = DB_LINE_RS485 };
static const struct db_bus_config rs232 = { .driver = &db_driver_vsmd_serial,
	                                    .line = DB_LINE_RS232 };

static const enum db_inquiry_kind kinds[] = { DB_INQUIRY_THERE,       DB_INQUIRY_IDENTITY,
	                                      DB_INQUIRY_STANDING,    DB_INQUIRY_SAVE,
	                                      DB_INQUIRY_SET_ADDRESS, DB_INQUIRY_SET_SPEED };
#define KINDS (sizeof(kinds) / sizeof(kinds[0]))

/* --- what is asked ------------------------------------------------------------------------------ */

static struct db_exchange asked;

/* The line without its end; null: it cannot be asked. */
static const char *ask_in(const struct db_bus_config *bus, enum db_inquiry_kind kind,
                          unsigned address, unsigned value, size_t size)
{
	static uint8_t bytes[DB_SHORT_REQUEST];
	static char text[DB_SHORT_REQUEST + 1];
	const struct db_inquiry inquiry = { .kind = kind, .address = address, .value = value };

	asked = (struct db_exchange){
		.request = bytes, .request_size = size, .answer_length = 1, .extra_time = 1
	};
	memset(bytes, 'x', sizeof(bytes));
	if (!db_driver_vsmd_serial.inquire(bus, &inquiry, &asked))
		return NULL;
	assert_int_equal(bytes[asked.request_length - 1], '\n');
	snprintf(text, sizeof(text), "%.*s", (int)asked.request_length - 1, (const char *)bytes);
	return text;
}

static const char *ask(const struct db_bus_config *bus, enum db_inquiry_kind kind, unsigned address,
                       unsigned value)
{
	return ask_in(bus, kind, address, value, DB_SHORT_REQUEST);
}

/* A line end first: the drive may have received anything at another speed. */
static void each_question_is_a_line_of_its_own(void **state)
{
	static const struct {
		enum db_inquiry_kind kind;
		unsigned value;
		const char *line;
		size_t answer;
		db_time extra;
	} cases[] = {
		{ DB_INQUIRY_THERE, 0, "\n7 sts", VSMD_SERIAL_STATUS_FRAME, 0 },
		{ DB_INQUIRY_THERE, 1, "\n7 sts", VSMD_SERIAL_STATUS_FRAME, 0 },
		{ DB_INQUIRY_STANDING, 0, "\n7 sts", VSMD_SERIAL_STATUS_FRAME, 0 },
		{ DB_INQUIRY_IDENTITY, 0, "\n7 dev", VSMD_IDENTITY_FRAME, 0 },
		{ DB_INQUIRY_SET_ADDRESS, 5, "\n7 cfg cid=5", VSMD_SERIAL_STATUS_FRAME, 0 },
		{ DB_INQUIRY_SET_SPEED, 115200, "\n7 cfg bdr=115200", VSMD_SERIAL_STATUS_FRAME, 0 },
		/* The flash takes its time. */
		{ DB_INQUIRY_SAVE, 0, "\n7 sav", VSMD_PARAMS_FRAME, DB_NS_PER_S },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		size_t size = strlen(cases[i].line) + 1;

		assert_string_equal(ask(&rs485, cases[i].kind, 7, cases[i].value), cases[i].line);
		assert_int_equal(asked.answer_length, cases[i].answer);
		assert_true(asked.extra_time == cases[i].extra);
		/* All of it, or nothing. */
		assert_string_equal(ask_in(&rs485, cases[i].kind, 7, cases[i].value, size),
		                    cases[i].line);
		assert_null(ask_in(&rs485, cases[i].kind, 7, cases[i].value, size - 1));
		assert_int_equal(asked.request[size - 1], 'x');
	}
}

/* 0 are all: many would answer, and all would take one address. On RS232 there is one drive. */
static void only_one_drive_is_asked(void **state)
{
	(void)state;
	for (size_t i = 0; i < KINDS; i++) {
		unsigned value = kinds[i] == DB_INQUIRY_SET_SPEED ? 9600 : 5;

		assert_null(ask(&rs485, kinds[i], 0, value));
		assert_non_null(ask(&rs485, kinds[i], 1, value));
		assert_non_null(ask(&rs485, kinds[i], VSMD_SERIAL_ID_MAX, value));
		assert_null(ask(&rs485, kinds[i], VSMD_SERIAL_ID_MAX + 1, value));
	}
	assert_string_equal(ask(&rs232, DB_INQUIRY_THERE, 1, 0), "\nsts");
	assert_string_equal(ask(&rs232, DB_INQUIRY_THERE, 0, 0), "\nsts");
	assert_string_equal(ask(&rs232, DB_INQUIRY_SET_ADDRESS, 40, 5), "\ncfg cid=5");
}

/* Nor does a drive get an address or a speed that none can have. */
static void no_drive_is_given_what_it_cannot_have(void **state)
{
	(void)state;
	assert_null(ask(&rs485, DB_INQUIRY_SET_ADDRESS, 7, 0));
	assert_null(ask(&rs485, DB_INQUIRY_SET_ADDRESS, 7, VSMD_SERIAL_ID_MAX + 1));
	assert_null(ask(&rs485, DB_INQUIRY_SET_SPEED, 7, 0));
	assert_null(ask(&rs485, DB_INQUIRY_SET_SPEED, 7, 1000000));
}

/* --- what is an answer -------------------------------------------------------------------------- */

static struct db_inquired said;

static enum db_recognised take(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                               const uint8_t *frame, int length)
{
	assert_true(length > 0);
	return db_driver_vsmd_serial.recognise(bus, inquiry, frame, (size_t)length, &said);
}

static enum db_recognised take_status(const struct db_bus_config *bus, enum db_inquiry_kind kind,
                                      unsigned value, uint8_t sender, uint32_t bits)
{
	const struct db_inquiry inquiry = { .kind = kind, .address = 7, .value = value };
	const struct vsmd_status status = { .status = bits };
	uint8_t frame[VSMD_SERIAL_STATUS_FRAME];

	memset(&said, 0, sizeof(said));
	return take(bus, &inquiry, frame,
	            vsmd_serial_encode_status(sender, &status, frame, sizeof(frame)));
}

static enum db_recognised take_text(enum db_inquiry_kind kind, enum vsmd_reply_code code,
                                    const char *text)
{
	const struct db_inquiry inquiry = { .kind = kind, .address = 7, .value = 5 };
	uint8_t frame[256];

	memset(&said, 0, sizeof(said));
	return take(&rs485, &inquiry, frame,
	            vsmd_serial_encode_text(7, code, text, strlen(text), frame, sizeof(frame)));
}

/* Of the drive that was asked; where there is one, whatever it calls itself. */
static void another_drive_does_not_answer(void **state)
{
	(void)state;
	for (size_t i = 0; i < KINDS; i++) {
		enum db_recognised own = kinds[i] == DB_INQUIRY_IDENTITY ? DB_RECOGNISED_NOTHING :
		                                                           DB_RECOGNISED_ANSWER;
		bool moves = kinds[i] == DB_INQUIRY_SET_ADDRESS;

		assert_int_equal(take_status(&rs485, kinds[i], 5, 7, VSMD_ST_STP), own);
		assert_int_equal(take_status(&rs485, kinds[i], 5, 8, VSMD_ST_STP),
		                 DB_RECOGNISED_NOTHING);
		/* It may have its new address already. */
		assert_int_equal(take_status(&rs485, kinds[i], 5, 5, VSMD_ST_STP),
		                 moves ? DB_RECOGNISED_ANSWER : DB_RECOGNISED_NOTHING);
		assert_int_equal(take_status(&rs232, kinds[i], 5, 8, VSMD_ST_STP), own);
	}
}

/* A text is asked for by its own question, and is the only answer to it where there is one. */
static void a_text_answers_its_question_only(void **state)
{
	(void)state;
	for (size_t i = 0; i < KINDS; i++) {
		assert_int_equal(take_text(kinds[i], VSMD_REPLY_IDENTITY, "VSMD"),
		                 kinds[i] == DB_INQUIRY_IDENTITY ? DB_RECOGNISED_ANSWER :
		                                                   DB_RECOGNISED_NOTHING);
		assert_int_equal(take_text(kinds[i], VSMD_REPLY_PARAMS, "mcs=4"),
		                 kinds[i] == DB_INQUIRY_SAVE ? DB_RECOGNISED_ANSWER :
		                                               DB_RECOGNISED_NOTHING);
		assert_false(said.refused);
		assert_false(said.tells_standing);
	}
}

static void a_status_tells_standing_and_refusal(void **state)
{
	(void)state;
	for (size_t i = 0; i < KINDS; i++) {
		bool saves = kinds[i] == DB_INQUIRY_SAVE;
		bool sets = kinds[i] == DB_INQUIRY_SET_ADDRESS || kinds[i] == DB_INQUIRY_SET_SPEED;

		if (kinds[i] == DB_INQUIRY_IDENTITY)
			continue;
		(void)take_status(&rs485, kinds[i], 5, 7, VSMD_ST_STP);
		assert_true(said.tells_standing && said.stands);
		/* A save that worked is answered with the parameters. */
		assert_int_equal(said.refused, saves);
		(void)take_status(&rs485, kinds[i], 5, 7, VSMD_ST_PWR);
		assert_true(said.tells_standing && !said.stands);
		assert_int_equal(said.refused, saves);
		/* That of a question is of what was said before. */
		(void)take_status(&rs485, kinds[i], 5, 7, VSMD_ST_STP | VSMD_ST_CMD_WRG);
		assert_true(said.stands);
		assert_int_equal(said.refused, saves || sets);
	}
}

/* Two drives at one address. */
static void a_second_answer_is_another_drives(void **state)
{
	const struct db_inquiry inquiry = { .kind = DB_INQUIRY_THERE, .address = 7 };
	const struct vsmd_status status = { .status = VSMD_ST_STP };
	uint8_t frame[VSMD_SERIAL_STATUS_FRAME];
	int length = vsmd_serial_encode_status(7, &status, frame, sizeof(frame));

	(void)state;
	memset(&said, 0, sizeof(said));
	/* A damaged one is no answer. */
	frame[5] ^= 1;
	assert_int_equal(take(&rs485, &inquiry, frame, length), DB_RECOGNISED_NOTHING);
	frame[5] ^= 1;
	assert_int_equal(take(&rs485, &inquiry, frame, length), DB_RECOGNISED_ANSWER);
	assert_int_equal(take(&rs485, &inquiry, frame, length), DB_RECOGNISED_AGAIN);
	assert_int_equal(take(&rs485, &inquiry, frame, length), DB_RECOGNISED_AGAIN);
}

/* The identity has no blanks at its ends and no quotation marks around it. It is cut to the room
 * that there is for it, and the answer tells nothing else. */
static void an_identity_is_the_words_of_the_text(void **state)
{
	static const char *const ends[][2] = { { "", "" },
		                               { " ", " " },
		                               { "\r\n \t ", "\r\n \t " },
		                               { "\"", "\"" },
		                               { " \"", "\"\r\n" } };

	(void)state;
	for (size_t i = 0; i < sizeof(ends) / sizeof(ends[0]); i++) {
		for (size_t length = 0; length <= DB_IDENTITY_MAX + 2; length++) {
			char words[DB_IDENTITY_MAX + 3] = "";
			char text[DB_IDENTITY_MAX + 16];
			struct db_inquired expected;

			memset(&expected, 0, sizeof(expected));
			memset(words, 'V', length);
			memcpy(expected.identity, words,
			       length < DB_IDENTITY_MAX ? length : DB_IDENTITY_MAX);
			snprintf(text, sizeof(text), "%s%s%s", ends[i][0], words, ends[i][1]);
			assert_int_equal(take_text(DB_INQUIRY_IDENTITY, VSMD_REPLY_IDENTITY, text),
			                 DB_RECOGNISED_ANSWER);
			expected.parts = said.parts;
			assert_memory_equal(&said, &expected, sizeof(said));
		}
	}
}

/* Nothing of the first one's is left in it. */
static void a_second_drives_identity_is_its_own(void **state)
{
	static const char *const names[] = { "VSMD-12", " V1" };
	const struct db_inquiry inquiry = { .kind = DB_INQUIRY_IDENTITY, .address = 7 };

	(void)state;
	memset(&said, 0, sizeof(said));
	for (size_t i = 0; i < 2; i++) {
		uint8_t frame[64];
		int length = vsmd_serial_encode_text(7, VSMD_REPLY_IDENTITY, names[i],
		                                     strlen(names[i]), frame, sizeof(frame));

		assert_int_equal(take(&rs485, &inquiry, frame, length),
		                 i == 0 ? DB_RECOGNISED_ANSWER : DB_RECOGNISED_AGAIN);
	}
	assert_string_equal(said.identity, "V1");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_question_is_a_line_of_its_own),
		cmocka_unit_test(only_one_drive_is_asked),
		cmocka_unit_test(no_drive_is_given_what_it_cannot_have),
		cmocka_unit_test(another_drive_does_not_answer),
		cmocka_unit_test(a_text_answers_its_question_only),
		cmocka_unit_test(a_status_tells_standing_and_refusal),
		cmocka_unit_test(a_second_answer_is_another_drives),
		cmocka_unit_test(an_identity_is_the_words_of_the_text),
		cmocka_unit_test(a_second_drives_identity_is_its_own),
	};

	return cmocka_run_group_tests_name("vsmd_serial_inquiry", tests, NULL, NULL);
}
