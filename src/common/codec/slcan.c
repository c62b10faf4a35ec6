/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/slcan.h"

#include <string.h>

#define STANDARD_DIGITS 3
#define EXTENDED_DIGITS 8
#define TIMESTAMP_DIGITS 4
#define BTR_DIGITS 4
#define FLAGS_DIGITS 2

/* --- bit rates -------------------------------------------------------------------------------- */

static const uint32_t BITRATES[] = { 10000,  20000,  50000,  100000, 125000,
	                             250000, 500000, 800000, 1000000 };

#define BITRATE_COUNT (sizeof(BITRATES) / sizeof(BITRATES[0]))

int slcan_bitrate_digit(uint32_t bitrate)
{
	for (size_t i = 0; i < BITRATE_COUNT; i++) {
		if (BITRATES[i] == bitrate)
			return (int)i;
	}
	return -1;
}

uint32_t slcan_bitrate(unsigned digit)
{
	return digit < BITRATE_COUNT ? BITRATES[digit] : 0;
}

/* --- lines ------------------------------------------------------------------------------------ */

static bool is_printable(uint8_t byte)
{
	return byte >= 0x20 && byte <= 0x7E;
}

enum slcan_took slcan_take(struct slcan_reader *reader, uint8_t byte)
{
	if (reader->complete)
		*reader = (struct slcan_reader){ 0 };
	if (byte == SLCAN_BEL) {
		*reader = (struct slcan_reader){ .line = { SLCAN_BEL },
			                         .length = 1,
			                         .complete = true };
		return SLCAN_TOOK_LINE;
	}
	if (byte == SLCAN_CR) {
		reader->complete = true;
		reader->line[reader->length++] = SLCAN_CR;
		return reader->spoilt ? SLCAN_TOOK_SPOILT : SLCAN_TOOK_LINE;
	}
	if (byte == '\n' || byte == 0)
		return SLCAN_TOOK_MORE;
	/* One byte is kept for the carriage return. */
	if (!is_printable(byte) || reader->length == SLCAN_LINE_MAX - 1)
		reader->spoilt = true;
	else
		reader->line[reader->length++] = (char)byte;
	return SLCAN_TOOK_MORE;
}

/* --- writing ---------------------------------------------------------------------------------- */

/* A line being written; an overflow is remembered. */
struct writer {
	char *line;
	size_t size;
	size_t length;
};

static void put(struct writer *writer, char character)
{
	if (writer->length < writer->size)
		writer->line[writer->length] = character;
	writer->length++;
}

static void put_hex(struct writer *writer, uint32_t value, unsigned digits)
{
	while (digits-- > 0)
		put(writer, "0123456789ABCDEF"[value >> (4 * digits) & 0xF]);
}

static int finish_line(struct writer *writer, char end)
{
	put(writer, end);
	return writer->length <= writer->size ? (int)writer->length : SLCAN_ERR_SPACE;
}

static enum slcan_error put_frame(struct writer *writer, const struct db_can_frame *frame)
{
	bool extended = frame->id & DB_CAN_EXTENDED;
	bool remote = frame->id & DB_CAN_REMOTE;
	uint32_t id = frame->id & DB_CAN_ID_MASK;

	if (frame->id & DB_CAN_ERROR || frame->length > DB_CAN_DATA_MAX ||
	    (!extended && id > DB_CAN_STANDARD_MASK))
		return SLCAN_ERR_RANGE;
	put(writer, "tTrR"[(extended ? 1 : 0) + (remote ? 2 : 0)]);
	put_hex(writer, id, extended ? EXTENDED_DIGITS : STANDARD_DIGITS);
	put_hex(writer, frame->length, 1);
	for (unsigned i = 0; i < frame->length && !remote; i++)
		put_hex(writer, frame->data[i], 2);
	return SLCAN_OK;
}

/* --- reading ---------------------------------------------------------------------------------- */

static int digit_value(char character)
{
	if (character >= '0' && character <= '9')
		return character - '0';
	if (character >= 'A' && character <= 'F')
		return character - 'A' + 10;
	if (character >= 'a' && character <= 'f')
		return character - 'a' + 10;
	return -1;
}

/* Moves *text on. False when there are too few digits. */
static bool take_hex(const char **text, const char *end, unsigned digits, uint32_t *value)
{
	*value = 0;
	while (digits-- > 0) {
		int digit = *text < end ? digit_value(**text) : -1;

		if (digit < 0)
			return false;
		*value = *value << 4 | (uint32_t)digit;
		(*text)++;
	}
	return true;
}

/* Exactly `digits` digits and nothing else. */
static enum slcan_error read_number(const char *text, const char *end, unsigned digits,
                                    uint32_t *value)
{
	return take_hex(&text, end, digits, value) && text == end ? SLCAN_OK : SLCAN_ERR_SYNTAX;
}

/* From the letter on; *text is left after the data. */
static enum slcan_error take_frame(const char **text, const char *end, struct db_can_frame *frame)
{
	char letter = *(*text)++;
	bool extended = letter == 'T' || letter == 'R';
	bool remote = letter == 'r' || letter == 'R';
	uint32_t value;

	if (!take_hex(text, end, extended ? EXTENDED_DIGITS : STANDARD_DIGITS, &value))
		return SLCAN_ERR_SYNTAX;
	if (value > (extended ? DB_CAN_ID_MASK : DB_CAN_STANDARD_MASK))
		return SLCAN_ERR_RANGE;
	frame->id = value | (extended ? DB_CAN_EXTENDED : 0) | (remote ? DB_CAN_REMOTE : 0);
	if (!take_hex(text, end, 1, &value))
		return SLCAN_ERR_SYNTAX;
	if (value > DB_CAN_DATA_MAX)
		return SLCAN_ERR_RANGE;
	frame->length = (uint8_t)value;
	for (unsigned i = 0; i < frame->length && !remote; i++) {
		if (!take_hex(text, end, 2, &value))
			return SLCAN_ERR_SYNTAX;
		frame->data[i] = (uint8_t)value;
	}
	return SLCAN_OK;
}

/* --- host to adapter -------------------------------------------------------------------------- */

static const char VERBS[SLCAN_VERB_COUNT] = {
	[SLCAN_SET_RATE] = 'S', [SLCAN_SET_BTR] = 's', [SLCAN_OPEN] = 'O',
	[SLCAN_LISTEN] = 'L',   [SLCAN_CLOSE] = 'C',   [SLCAN_VERSION] = 'V',
	[SLCAN_SERIAL] = 'N',   [SLCAN_FLAGS] = 'F',   [SLCAN_TIMESTAMPS] = 'Z',
};

int slcan_encode_command(const struct slcan_command *command, char *line, size_t size)
{
	struct writer writer = { .line = line, .size = size };

	if ((unsigned)command->verb >= SLCAN_VERB_COUNT)
		return SLCAN_ERR_RANGE;
	if (VERBS[command->verb])
		put(&writer, VERBS[command->verb]);
	switch (command->verb) {
	case SLCAN_SEND: {
		enum slcan_error error = put_frame(&writer, &command->frame);

		if (error != SLCAN_OK)
			return error;
		break;
	}
	case SLCAN_SET_RATE:
	case SLCAN_TIMESTAMPS:
		if (command->digit >= (command->verb == SLCAN_TIMESTAMPS ? 2 : BITRATE_COUNT))
			return SLCAN_ERR_RANGE;
		put_hex(&writer, command->digit, 1);
		break;
	case SLCAN_SET_BTR:
		put_hex(&writer, command->btr, BTR_DIGITS);
		break;
	default:
		break;
	}
	return finish_line(&writer, SLCAN_CR);
}

enum slcan_error slcan_decode_command(const char *line, size_t length,
                                      struct slcan_command *command)
{
	const char *text = line;
	enum slcan_error error;
	const char *end;
	uint32_t value;

	*command = (struct slcan_command){ .verb = SLCAN_NOTHING };
	if (length == 0 || line[length - 1] != SLCAN_CR)
		return SLCAN_ERR_SYNTAX;
	if (length == 1)
		return SLCAN_OK;
	end = line + length - 1;
	/* strchr() also finds the zero at the end of its string. */
	if (!is_printable((uint8_t)*text))
		return SLCAN_ERR_SYNTAX;
	command->verb = strchr("tTrR", *text) ? SLCAN_SEND : SLCAN_VERB_COUNT;
	for (unsigned verb = 0; command->verb == SLCAN_VERB_COUNT && verb < SLCAN_VERB_COUNT;
	     verb++) {
		if (VERBS[verb] == *text)
			command->verb = (enum slcan_verb)verb;
	}
	/* Then the arguments, which follow the letter of the command. */
	switch (command->verb) {
	case SLCAN_VERB_COUNT:
		return SLCAN_ERR_SYNTAX;
	case SLCAN_SEND:
		error = take_frame(&text, end, &command->frame);
		return error == SLCAN_OK && text != end ? SLCAN_ERR_SYNTAX : error;
	case SLCAN_SET_RATE:
	case SLCAN_TIMESTAMPS:
		error = read_number(text + 1, end, 1, &value);
		command->digit = (uint8_t)value;
		if (error != SLCAN_OK)
			return error;
		return value < (command->verb == SLCAN_TIMESTAMPS ? 2 : BITRATE_COUNT) ?
		               SLCAN_OK :
		               SLCAN_ERR_RANGE;
	case SLCAN_SET_BTR:
		error = read_number(text + 1, end, BTR_DIGITS, &value);
		command->btr = (uint16_t)value;
		return error;
	default:
		return text + 1 == end ? SLCAN_OK : SLCAN_ERR_SYNTAX;
	}
}

/* --- adapter to host -------------------------------------------------------------------------- */

static bool is_text(const char *text, size_t length)
{
	if (length == 0 || length > SLCAN_TEXT_MAX)
		return false;
	for (size_t i = 0; i < length; i++) {
		if (!is_printable((uint8_t)text[i]))
			return false;
	}
	return true;
}

int slcan_encode_reply(const struct slcan_reply *reply, char *line, size_t size)
{
	struct writer writer = { .line = line, .size = size };
	enum slcan_error error;

	switch (reply->kind) {
	case SLCAN_REPLY_DONE:
		return finish_line(&writer, SLCAN_CR);
	case SLCAN_REPLY_REFUSED:
		return finish_line(&writer, SLCAN_BEL);
	case SLCAN_REPLY_FRAME:
		error = put_frame(&writer, &reply->frame);
		if (error != SLCAN_OK)
			return error;
		if (reply->has_timestamp)
			put_hex(&writer, reply->timestamp, TIMESTAMP_DIGITS);
		return finish_line(&writer, SLCAN_CR);
	case SLCAN_REPLY_SENT:
		put(&writer, reply->extended ? 'Z' : 'z');
		return finish_line(&writer, SLCAN_CR);
	case SLCAN_REPLY_FLAGS:
		put(&writer, 'F');
		put_hex(&writer, reply->flags, FLAGS_DIGITS);
		return finish_line(&writer, SLCAN_CR);
	case SLCAN_REPLY_VERSION:
	case SLCAN_REPLY_SERIAL:
		if (!is_text(reply->text, strnlen(reply->text, sizeof(reply->text))))
			return SLCAN_ERR_RANGE;
		put(&writer, reply->kind == SLCAN_REPLY_VERSION ? 'V' : 'N');
		for (const char *text = reply->text; *text; text++)
			put(&writer, *text);
		return finish_line(&writer, SLCAN_CR);
	default:
		return SLCAN_ERR_RANGE;
	}
}

enum slcan_error slcan_decode_reply(const char *line, size_t length, struct slcan_reply *reply)
{
	enum slcan_error error;
	const char *end;
	uint32_t value;

	*reply = (struct slcan_reply){ .kind = SLCAN_REPLY_DONE };
	if (length == 1 && *line == SLCAN_BEL)
		reply->kind = SLCAN_REPLY_REFUSED;
	if (length == 1 && (*line == SLCAN_BEL || *line == SLCAN_CR))
		return SLCAN_OK;
	if (length < 2 || line[length - 1] != SLCAN_CR)
		return SLCAN_ERR_SYNTAX;
	end = line + length - 1;
	switch (*line) {
	case 't':
	case 'T':
	case 'r':
	case 'R':
		reply->kind = SLCAN_REPLY_FRAME;
		error = take_frame(&line, end, &reply->frame);
		if (error != SLCAN_OK || line == end)
			return error;
		error = read_number(line, end, TIMESTAMP_DIGITS, &value);
		reply->has_timestamp = error == SLCAN_OK;
		reply->timestamp = (uint16_t)value;
		return error;
	case 'z':
	case 'Z':
		reply->kind = SLCAN_REPLY_SENT;
		reply->extended = *line == 'Z';
		return length == 2 ? SLCAN_OK : SLCAN_ERR_SYNTAX;
	case 'F':
		reply->kind = SLCAN_REPLY_FLAGS;
		error = read_number(line + 1, end, FLAGS_DIGITS, &value);
		reply->flags = (uint8_t)value;
		return error;
	case 'V':
	case 'N':
		reply->kind = *line == 'V' ? SLCAN_REPLY_VERSION : SLCAN_REPLY_SERIAL;
		if (!is_text(line + 1, length - 2))
			return SLCAN_ERR_SYNTAX;
		memcpy(reply->text, line + 1, length - 2);
		return SLCAN_OK;
	default:
		return SLCAN_ERR_SYNTAX;
	}
}
