/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/slcan.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define EXT DB_CAN_EXTENDED
#define RTR DB_CAN_REMOTE

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static void assert_frame(const struct db_can_frame *got, const struct db_can_frame *want)
{
	assert_int_equal(got->id, want->id);
	assert_int_equal(got->length, want->length);
	assert_memory_equal(got->data, want->data, sizeof want->data);
}

static void bit_rates_have_their_digits(void **state)
{
	static const uint32_t rates[] = { 10000,  20000,  50000,  100000, 125000,
		                          250000, 500000, 800000, 1000000 };

	(void)state;
	for (unsigned i = 0; i < COUNT(rates); i++) {
		assert_int_equal(slcan_bitrate_digit(rates[i]), i);
		assert_int_equal(slcan_bitrate(i), rates[i]);
	}
	assert_int_equal(slcan_bitrate_digit(0), -1);
	assert_int_equal(slcan_bitrate_digit(999999), -1);
	assert_int_equal(slcan_bitrate(9), 0);
}

/* --- commands ------------------------------------------------------------------------------------- */

static const struct {
	const char *line;
	struct slcan_command command;
} COMMANDS[] = {
	{ "\r", { .verb = SLCAN_NOTHING } },
	{ "S0\r", { .verb = SLCAN_SET_RATE, .digit = 0 } },
	{ "S8\r", { .verb = SLCAN_SET_RATE, .digit = 8 } },
	{ "s031C\r", { .verb = SLCAN_SET_BTR, .btr = 0x031C } },
	{ "O\r", { .verb = SLCAN_OPEN } },
	{ "L\r", { .verb = SLCAN_LISTEN } },
	{ "C\r", { .verb = SLCAN_CLOSE } },
	{ "V\r", { .verb = SLCAN_VERSION } },
	{ "N\r", { .verb = SLCAN_SERIAL } },
	{ "F\r", { .verb = SLCAN_FLAGS } },
	{ "Z0\r", { .verb = SLCAN_TIMESTAMPS, .digit = 0 } },
	{ "Z1\r", { .verb = SLCAN_TIMESTAMPS, .digit = 1 } },
	{ "t10021133\r",
	  { .verb = SLCAN_SEND, .frame = { .id = 0x100, .length = 2, .data = { 0x11, 0x33 } } } },
	{ "t7FF0\r", { .verb = SLCAN_SEND, .frame = { .id = 0x7FF } } },
	{ "T0000010021133\r",
	  { .verb = SLCAN_SEND,
	    .frame = { .id = EXT | 0x100, .length = 2, .data = { 0x11, 0x33 } } } },
	{ "T1FFFFFFF80123456789ABCDEF\r",
	  { .verb = SLCAN_SEND,
	    .frame = { .id = EXT | 0x1FFFFFFF,
	               .length = 8,
	               .data = { 0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF } } } },
	{ "r1008\r", { .verb = SLCAN_SEND, .frame = { .id = RTR | 0x100, .length = 8 } } },
	{ "R00ABCDEF0\r", { .verb = SLCAN_SEND, .frame = { .id = EXT | RTR | 0xABCDEF } } },
};

static void commands_are_written(void **state)
{
	char line[SLCAN_LINE_MAX];

	(void)state;
	for (size_t i = 0; i < COUNT(COMMANDS); i++) {
		int length = slcan_encode_command(&COMMANDS[i].command, line, sizeof line);

		assert_int_equal(length, strlen(COMMANDS[i].line));
		assert_memory_equal(line, COMMANDS[i].line, (size_t)length);
		assert_int_equal(
			slcan_encode_command(&COMMANDS[i].command, line, (size_t)length - 1),
			SLCAN_ERR_SPACE);
	}
}

static void commands_are_read(void **state)
{
	struct slcan_command command;

	(void)state;
	for (size_t i = 0; i < COUNT(COMMANDS); i++) {
		const char *line = COMMANDS[i].line;

		assert_int_equal(slcan_decode_command(line, strlen(line), &command), SLCAN_OK);
		assert_int_equal(command.verb, COMMANDS[i].command.verb);
		assert_int_equal(command.digit, COMMANDS[i].command.digit);
		assert_int_equal(command.btr, COMMANDS[i].command.btr);
		assert_frame(&command.frame, &COMMANDS[i].command.frame);
	}
}

static void small_hex_digits_are_read_too(void **state)
{
	static const struct db_can_frame want = { .id = EXT | 0x1abcdef0,
		                                  .length = 2,
		                                  .data = { 0xab, 0xcd } };
	struct slcan_command command;
	struct slcan_reply reply;

	(void)state;
	assert_int_equal(slcan_decode_command("T1abcdef02abCd\r", 15, &command), SLCAN_OK);
	assert_frame(&command.frame, &want);
	assert_int_equal(slcan_decode_reply("T1abcdef02abCd\r", 15, &reply), SLCAN_OK);
	assert_frame(&reply.frame, &want);
}

static void wrong_commands_are_refused(void **state)
{
	static const struct {
		const char *line;
		enum slcan_error error;
	} wrong[] = {
		{ "", SLCAN_ERR_SYNTAX },
		{ "O", SLCAN_ERR_SYNTAX },
		{ "\a", SLCAN_ERR_SYNTAX },
		{ "O\r\r", SLCAN_ERR_SYNTAX },
		{ "OO\r", SLCAN_ERR_SYNTAX },
		{ "o\r", SLCAN_ERR_SYNTAX },
		{ "X\r", SLCAN_ERR_SYNTAX },
		{ " C\r", SLCAN_ERR_SYNTAX },
		{ "S\r", SLCAN_ERR_SYNTAX },
		{ "S88\r", SLCAN_ERR_SYNTAX },
		{ "Sg\r", SLCAN_ERR_SYNTAX },
		{ "S9\r", SLCAN_ERR_RANGE },
		{ "SA\r", SLCAN_ERR_RANGE },
		{ "Z2\r", SLCAN_ERR_RANGE },
		{ "s31C\r", SLCAN_ERR_SYNTAX },
		{ "s0031C\r", SLCAN_ERR_SYNTAX },
		{ "t\r", SLCAN_ERR_SYNTAX },
		{ "t100\r", SLCAN_ERR_SYNTAX },
		{ "t1G00\r", SLCAN_ERR_SYNTAX },
		{ "t8000\r", SLCAN_ERR_RANGE },
		{ "t1009\r", SLCAN_ERR_RANGE },
		{ "t100211\r", SLCAN_ERR_SYNTAX },
		{ "t1002113\r", SLCAN_ERR_SYNTAX },
		{ "t100211334\r", SLCAN_ERR_SYNTAX },
		{ "t100211330000\r", SLCAN_ERR_SYNTAX },
		{ "r100211\r", SLCAN_ERR_SYNTAX },
		{ "T200000000\r", SLCAN_ERR_RANGE },
		{ "T1000\r", SLCAN_ERR_SYNTAX },
	};
	struct slcan_command command;

	(void)state;
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_int_equal(
			slcan_decode_command(wrong[i].line, strlen(wrong[i].line), &command),
			wrong[i].error);
	assert_int_equal(slcan_decode_command("\0\r", 2, &command), SLCAN_ERR_SYNTAX);
}

static void what_no_line_can_say_is_not_written(void **state)
{
	static const struct slcan_command wrong[] = {
		{ .verb = SLCAN_VERB_COUNT },
		{ .verb = SLCAN_SET_RATE, .digit = 9 },
		{ .verb = SLCAN_TIMESTAMPS, .digit = 2 },
		{ .verb = SLCAN_SEND, .frame = { .id = 0x800 } },
		{ .verb = SLCAN_SEND, .frame = { .id = 0x100, .length = 9 } },
		{ .verb = SLCAN_SEND, .frame = { .id = DB_CAN_ERROR | 0x40, .length = 8 } },
	};
	struct slcan_reply long_name = { .kind = SLCAN_REPLY_VERSION };
	struct slcan_reply no_name = { .kind = SLCAN_REPLY_SERIAL };
	struct slcan_reply unknown = { .kind = SLCAN_REPLY_COUNT };
	char line[SLCAN_LINE_MAX];

	(void)state;
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_int_equal(slcan_encode_command(&wrong[i], line, sizeof line),
		                 SLCAN_ERR_RANGE);
	memset(long_name.text, '1', sizeof long_name.text);
	assert_int_equal(slcan_encode_reply(&long_name, line, sizeof line), SLCAN_ERR_RANGE);
	assert_int_equal(slcan_encode_reply(&no_name, line, sizeof line), SLCAN_ERR_RANGE);
	assert_int_equal(slcan_encode_reply(&unknown, line, sizeof line), SLCAN_ERR_RANGE);
}

/* --- replies -------------------------------------------------------------------------------------- */

static const struct {
	const char *line;
	struct slcan_reply reply;
} REPLIES[] = {
	{ "\r", { .kind = SLCAN_REPLY_DONE } },
	{ "\a", { .kind = SLCAN_REPLY_REFUSED } },
	{ "z\r", { .kind = SLCAN_REPLY_SENT } },
	{ "Z\r", { .kind = SLCAN_REPLY_SENT, .extended = true } },
	{ "F00\r", { .kind = SLCAN_REPLY_FLAGS } },
	{ "FA4\r",
	  { .kind = SLCAN_REPLY_FLAGS,
	    .flags = SLCAN_BUS_ERROR | SLCAN_ERROR_PASSIVE | SLCAN_ERROR_WARNING } },
	{ "F4B\r",
	  { .kind = SLCAN_REPLY_FLAGS,
	    .flags = SLCAN_ARBITRATION_LOST | SLCAN_DATA_OVERRUN | SLCAN_TX_FULL |
	             SLCAN_RX_FULL } },
	{ "V1013\r", { .kind = SLCAN_REPLY_VERSION, .text = "1013" } },
	{ "NA123\r", { .kind = SLCAN_REPLY_SERIAL, .text = "A123" } },
	{ "t10021133\r",
	  { .kind = SLCAN_REPLY_FRAME,
	    .frame = { .id = 0x100, .length = 2, .data = { 0x11, 0x33 } } } },
	{ "t10020102EA5F\r",
	  { .kind = SLCAN_REPLY_FRAME,
	    .frame = { .id = 0x100, .length = 2, .data = { 1, 2 } },
	    .has_timestamp = true,
	    .timestamp = 59999 } },
	{ "T1FFFFFFF80123456789ABCDEF0000\r",
	  { .kind = SLCAN_REPLY_FRAME,
	    .frame = { .id = EXT | 0x1FFFFFFF,
	               .length = 8,
	               .data = { 0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF } },
	    .has_timestamp = true } },
	{ "r1008\r", { .kind = SLCAN_REPLY_FRAME, .frame = { .id = RTR | 0x100, .length = 8 } } },
	{ "R00000100200FF\r",
	  { .kind = SLCAN_REPLY_FRAME,
	    .frame = { .id = EXT | RTR | 0x100, .length = 2 },
	    .has_timestamp = true,
	    .timestamp = 255 } },
};

static void replies_are_written(void **state)
{
	char line[SLCAN_LINE_MAX];

	(void)state;
	for (size_t i = 0; i < COUNT(REPLIES); i++) {
		int length = slcan_encode_reply(&REPLIES[i].reply, line, sizeof line);

		assert_int_equal(length, strlen(REPLIES[i].line));
		assert_memory_equal(line, REPLIES[i].line, (size_t)length);
		assert_int_equal(slcan_encode_reply(&REPLIES[i].reply, line, (size_t)length - 1),
		                 SLCAN_ERR_SPACE);
	}
}

static void replies_are_read(void **state)
{
	struct slcan_reply reply;

	(void)state;
	for (size_t i = 0; i < COUNT(REPLIES); i++) {
		const struct slcan_reply *want = &REPLIES[i].reply;

		assert_int_equal(
			slcan_decode_reply(REPLIES[i].line, strlen(REPLIES[i].line), &reply),
			SLCAN_OK);
		assert_int_equal(reply.kind, want->kind);
		assert_frame(&reply.frame, &want->frame);
		assert_int_equal(reply.has_timestamp, want->has_timestamp);
		assert_int_equal(reply.timestamp, want->timestamp);
		assert_int_equal(reply.extended, want->extended);
		assert_int_equal(reply.flags, want->flags);
		assert_string_equal(reply.text, want->text);
	}
}

static void wrong_replies_are_refused(void **state)
{
	static const struct {
		const char *line;
		enum slcan_error error;
	} wrong[] = {
		{ "", SLCAN_ERR_SYNTAX },
		{ "z", SLCAN_ERR_SYNTAX },
		{ "zz\r", SLCAN_ERR_SYNTAX },
		{ "z\a", SLCAN_ERR_SYNTAX },
		{ "\r\r", SLCAN_ERR_SYNTAX },
		{ "O\r", SLCAN_ERR_SYNTAX },
		{ "F0\r", SLCAN_ERR_SYNTAX },
		{ "F000\r", SLCAN_ERR_SYNTAX },
		{ "F0x\r", SLCAN_ERR_SYNTAX },
		{ "V\r", SLCAN_ERR_SYNTAX },
		{ "V12345678901234567\r", SLCAN_ERR_SYNTAX },
		{ "t100211\r", SLCAN_ERR_SYNTAX },
		{ "t1002112\r", SLCAN_ERR_SYNTAX },
		{ "t10021133123\r", SLCAN_ERR_SYNTAX },
		{ "t1002113312345\r", SLCAN_ERR_SYNTAX },
		{ "t8000\r", SLCAN_ERR_RANGE },
		{ "t1009\r", SLCAN_ERR_RANGE },
		{ "TFFFFFFFF0\r", SLCAN_ERR_RANGE },
	};
	struct slcan_reply reply;

	(void)state;
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_int_equal(slcan_decode_reply(wrong[i].line, strlen(wrong[i].line), &reply),
		                 wrong[i].error);
}

/* --- lines ---------------------------------------------------------------------------------------- */

/* Feeds all and writes what came of it: each line, "!" for a spoilt one, CR as ";", BEL as "#". */
static void feed(const char *bytes, size_t length, char *told)
{
	struct slcan_reader reader = { 0 };

	for (size_t i = 0; i < length; i++) {
		switch (slcan_take(&reader, (uint8_t)bytes[i])) {
		case SLCAN_TOOK_LINE:
			for (size_t k = 0; k < reader.length; k++) {
				char one = reader.line[k];

				*told++ = (char)(one == '\r' ? ';' : one == '\a' ? '#' : one);
			}
			break;
		case SLCAN_TOOK_SPOILT:
			*told++ = '!';
			break;
		default:
			break;
		}
	}
	*told = '\0';
}

static void lines_are_cut_out_of_what_comes(void **state)
{
	static const struct {
		const char *bytes;
		const char *told;
	} streams[] = {
		{ "\r\r\rC\r", ";;;C;" },
		{ "z\rt1000\r\aZ\r", "z;t1000;#Z;" },
		/* BEL ends a half line and says that it was refused. */
		{ "t10\aF00\r", "#F00;" },
		{ "z\r\nF00\r\n\r", "z;F00;;" },
		{ "t10\x80"
		  "00\rz\r",
		  "!z;" },
		{ "\xFF\xFE\a\r", "#;" },
		/* The longest line there is, and one character more. */
		{ "T1FFFFFFF80123456789ABCDEF0000\r", "T1FFFFFFF80123456789ABCDEF0000;" },
		{ "T1FFFFFFF80123456789ABCDEF00000\rz\r", "!z;" },
		/* The end of a line that was too long is no line. */
		{ "0123456789012345678901234567890123456789t1230\rt1231AA\r", "!t1231AA;" },
		{ "t1230", "" },
	};
	char told[128];

	(void)state;
	for (size_t i = 0; i < COUNT(streams); i++) {
		feed(streams[i].bytes, strlen(streams[i].bytes), told);
		assert_string_equal(told, streams[i].told);
	}
	feed("z\0\r\0\0t1000\0\r", 12, told);
	assert_string_equal(told, "z;t1000;");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(bit_rates_have_their_digits),
		cmocka_unit_test(commands_are_written),
		cmocka_unit_test(commands_are_read),
		cmocka_unit_test(small_hex_digits_are_read_too),
		cmocka_unit_test(wrong_commands_are_refused),
		cmocka_unit_test(what_no_line_can_say_is_not_written),
		cmocka_unit_test(replies_are_written),
		cmocka_unit_test(replies_are_read),
		cmocka_unit_test(wrong_replies_are_refused),
		cmocka_unit_test(lines_are_cut_out_of_what_comes),
	};

	return cmocka_run_group_tests_name("slcan codec", tests, NULL, NULL);
}
