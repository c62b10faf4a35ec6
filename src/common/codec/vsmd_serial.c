/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_serial.h"

#include "codec/vsmd_numbers.h"
#include "codec/vsmd_serial_frames.h"

#include <string.h>

#define NAME_MAX_LENGTH 8 /* maximum length of a parameter's name */

/* --- writing command lines -------------------------------------------------------------------- */

/* A line being written; after an overflow or a value out of range, `error` stays. */
struct writer {
	char *text;
	size_t size;
	size_t length;
	int error;
};

static void put_bytes(struct writer *writer, const char *text, size_t length)
{
	if (writer->error)
		return;
	if (length > writer->size - writer->length) {
		writer->error = VSMD_ERR_SPACE;
		return;
	}
	memcpy(writer->text + writer->length, text, length);
	writer->length += length;
}

/* For a literal the compiler computes the length. */
static inline void put(struct writer *writer, const char *text)
{
	put_bytes(writer, text, strlen(text));
}

static void put_value(struct writer *writer, enum db_type type, union db_value value)
{
	char text[128];
	int length = vsmd_format_value(type, value, text, sizeof(text));

	if (length >= 0)
		put_bytes(writer, text, (size_t)length);
	else if (!writer->error)
		writer->error = length;
}

static void put_int(struct writer *writer, int32_t number)
{
	put_value(writer, DB_I32, (union db_value){ .i = number });
}

static void put_float(struct writer *writer, const char *before, float number, float min, float max)
{
	if (!(number >= min && number <= max) && !writer->error)
		writer->error = VSMD_ERR_RANGE;
	put(writer, before);
	put_value(writer, DB_F32, (union db_value){ .f = number });
}

/* A small unsigned number that must not exceed max. */
static void put_small(struct writer *writer, unsigned number, unsigned min, unsigned max)
{
	if ((number < min || number > max) && !writer->error)
		writer->error = VSMD_ERR_RANGE;
	put_value(writer, DB_U32, (union db_value){ .u = number });
}

static void put_shake(struct writer *writer, const struct vsmd_command *command, const char *limit)
{
	put(writer, "shake start spos=");
	put_int(writer, command->shake_start);
	put(writer, " epos=");
	put_int(writer, command->shake_end);
	put_float(writer, " freq=", command->shake_frequency, VSMD_SHAKE_FREQ_MIN,
	          VSMD_SHAKE_FREQ_MAX);
	put(writer, limit);
	put_small(writer, command->shake_count, 0, INT32_MAX);
}

static void put_settings(struct writer *writer, const struct vsmd_command *command)
{
	if (command->setting_count == 0 && !writer->error)
		writer->error = VSMD_ERR_SYNTAX;
	put(writer, "cfg");
	for (size_t i = 0; i < command->setting_count; i++) {
		const struct vsmd_setting *setting = &command->settings[i];

		if ((unsigned)setting->param >= VSMD_PARAM_COUNT ||
		    !vsmd_param_in_range(setting->param, setting->value)) {
			writer->error = VSMD_ERR_RANGE;
			return;
		}
		put(writer, " ");
		put(writer, vsmd_params[setting->param].name);
		put(writer, "=");
		put_value(writer, vsmd_params[setting->param].type, setting->value);
	}
}

/* Verbs with a single fixed text. */
static const char *const fixed[VSMD_VERB_COUNT] = {
	[VSMD_DEV] = "dev",
	[VSMD_STS] = "sts",
	[VSMD_ENA] = "ena",
	[VSMD_OFF] = "off",
	[VSMD_ECLR] = "eclr",
	[VSMD_ZERO_START] = "zero start",
	[VSMD_ZERO_STOP] = "zero stop",
	[VSMD_SHAKE_STOP] = "shake stop",
	[VSMD_CFG_READ] = "cfg",
	[VSMD_SAV] = "sav",
};

static void put_command(struct writer *writer, const struct vsmd_command *command)
{
	switch (command->verb) {
	case VSMD_MOV:
		put(writer, "mov");
		if (command->has_velocity)
			put_float(writer, " spd=", command->velocity, -VSMD_SPEED_MAX,
			          VSMD_SPEED_MAX);
		break;
	case VSMD_POS:
	case VSMD_RMV:
		put(writer, command->verb == VSMD_POS ? "pos " : "rmv ");
		put_int(writer, command->position);
		if (command->has_velocity)
			put_float(writer, " spd=", command->velocity, 0.0f, VSMD_SPEED_MAX);
		break;
	case VSMD_STP:
	case VSMD_ORG:
		put(writer, command->verb == VSMD_STP ? "stp" : "org");
		if (!command->has_value)
			break;
		put(writer, " ");
		if (command->verb == VSMD_STP)
			put_small(writer, command->value, 0, 1);
		else
			put_int(writer, command->position);
		break;
	case VSMD_SENSOR_OUT:
		put(writer, "s");
		put_small(writer, command->port, 1, 6);
		if (command->value > 1 && !writer->error)
			writer->error = VSMD_ERR_RANGE;
		put(writer, command->value ? " on" : " off");
		break;
	case VSMD_SV:
	case VSMD_NMOS:
		put(writer, command->verb == VSMD_SV ? "sv" : "nmos");
		put_small(writer, command->port, 1, 3);
		put(writer, " ");
		put_small(writer, command->value, 0, 255);
		break;
	case VSMD_SHAKE_CYCLES:
		put_shake(writer, command, " cycles=");
		break;
	case VSMD_SHAKE_TIME:
		put_shake(writer, command, " time=");
		break;
	case VSMD_CFG_WRITE:
		put_settings(writer, command);
		break;
	default:
		if ((unsigned)command->verb < VSMD_VERB_COUNT && fixed[command->verb])
			put(writer, fixed[command->verb]);
		else
			writer->error = VSMD_ERR_SYNTAX;
		break;
	}
}

int vsmd_serial_encode_command(const struct vsmd_command *command, char *line, size_t size)
{
	struct writer writer = { .text = line, .size = size };

	if (command->id != VSMD_SERIAL_NO_ID) {
		if (command->id < 0 || command->id > VSMD_SERIAL_ID_MAX)
			return VSMD_ERR_RANGE;
		put_int(&writer, command->id);
		put(&writer, " ");
	}
	put_command(&writer, command);
	put(&writer, "\n");
	return writer.error ? writer.error : (int)writer.length;
}

/* --- reading command lines -------------------------------------------------------------------- */

struct word {
	const char *text;
	size_t length;
};

struct reader {
	const char *text;
	size_t length;
	size_t at;
};

static bool next_word(struct reader *reader, struct word *word)
{
	while (reader->at < reader->length && reader->text[reader->at] == ' ')
		reader->at++;
	word->text = reader->text + reader->at;
	while (reader->at < reader->length && reader->text[reader->at] != ' ')
		reader->at++;
	word->length = (size_t)(reader->text + reader->at - word->text);
	return word->length > 0;
}

static bool is(struct word word, const char *text)
{
	return word.length == strlen(text) && memcmp(word.text, text, word.length) == 0;
}

/*
 * vsmd_parse_number() for commands, which are strict: digits on both sides of a decimal point.
 * Drives are not held to that in what they send.
 */
static bool parse_strict(struct word word, double *number, bool *whole)
{
	const char *point = memchr(word.text, '.', word.length);

	if (point &&
	    (point == word.text || point[-1] < '0' || point + 1 == word.text + word.length))
		return false;
	return vsmd_parse_number(word.text, word.length, number, whole);
}

/* A whole number in a range; commands are strict, so "1.0" is invalid. */
static enum vsmd_error read_whole(struct word word, double min, double max, double *number)
{
	bool whole;

	if (word.length == 0 || memchr(word.text, '.', word.length) ||
	    !vsmd_parse_number(word.text, word.length, number, &whole))
		return VSMD_ERR_SYNTAX;
	return *number >= min && *number <= max ? VSMD_OK : VSMD_ERR_RANGE;
}

static enum vsmd_error read_int(struct word word, int32_t *value)
{
	double number;
	enum vsmd_error error = read_whole(word, INT32_MIN, INT32_MAX, &number);

	if (error == VSMD_OK)
		*value = (int32_t)number;
	return error;
}

static enum vsmd_error read_float(struct word word, double min, double max, float *value)
{
	double number;
	bool whole;

	if (!parse_strict(word, &number, &whole))
		return VSMD_ERR_SYNTAX;
	*value = (float)number;
	return (double)*value >= (double)(float)min && (double)*value <= (double)(float)max ?
	               VSMD_OK :
	               VSMD_ERR_RANGE;
}

/* If the word is "name=...", reduces it to the part after that. */
static bool take_name(struct word *word, const char *name)
{
	size_t length = strlen(name);

	if (word->length <= length || memcmp(word->text, name, length) != 0 ||
	    word->text[length] != '=')
		return false;
	word->text += length + 1;
	word->length -= length + 1;
	return true;
}

/* Each motion may end with a speed; all but running need a number before it. */
static enum vsmd_error read_move(struct reader *reader, struct vsmd_command *command)
{
	double min = command->verb == VSMD_MOV ? -(double)VSMD_SPEED_MAX : 0.0;
	enum vsmd_error error;
	struct word word;

	if (command->verb != VSMD_MOV) {
		if (!next_word(reader, &word))
			return VSMD_ERR_SYNTAX;
		error = read_int(word, &command->position);
		if (error != VSMD_OK)
			return error;
	}
	if (!next_word(reader, &word))
		return VSMD_OK;
	if (!take_name(&word, "spd"))
		return VSMD_ERR_SYNTAX;
	command->has_velocity = true;
	return read_float(word, min, (double)VSMD_SPEED_MAX, &command->velocity);
}

/* Stop and origin may have a value; sv and nmos must have one, their duty. */
static enum vsmd_error read_value(struct reader *reader, struct vsmd_command *command)
{
	bool duty = command->verb == VSMD_SV || command->verb == VSMD_NMOS;
	enum vsmd_error error;
	struct word word;
	double number;

	if (!next_word(reader, &word))
		return duty ? VSMD_ERR_SYNTAX : VSMD_OK;
	command->has_value = !duty;
	if (command->verb == VSMD_ORG)
		return read_int(word, &command->position);
	error = read_whole(word, 0, duty ? 255 : 1, &number);
	if (error == VSMD_OK)
		command->value = (uint8_t)number;
	return error;
}

enum shake_word { SHAKE_SPOS = 1, SHAKE_EPOS = 2, SHAKE_FREQ = 4, SHAKE_LIMIT = 8, SHAKE_ALL = 15 };

static enum vsmd_error read_shake_word(struct word word, struct vsmd_command *command, int *seen)
{
	enum vsmd_verb verb = command->verb;
	enum vsmd_error error;
	enum shake_word which;
	double number;

	if (take_name(&word, "spos")) {
		which = SHAKE_SPOS;
	} else if (take_name(&word, "epos")) {
		which = SHAKE_EPOS;
	} else if (take_name(&word, "freq")) {
		which = SHAKE_FREQ;
	} else if (take_name(&word, "cycles")) {
		which = SHAKE_LIMIT;
		verb = VSMD_SHAKE_CYCLES;
	} else if (take_name(&word, "time")) {
		which = SHAKE_LIMIT;
		verb = VSMD_SHAKE_TIME;
	} else {
		return VSMD_ERR_SYNTAX;
	}
	/* The word was there before: which of the two would count is not documented. */
	if (*seen & (int)which)
		return VSMD_ERR_SYNTAX;
	*seen |= (int)which;
	switch (which) {
	case SHAKE_SPOS:
		return read_int(word, &command->shake_start);
	case SHAKE_EPOS:
		return read_int(word, &command->shake_end);
	case SHAKE_FREQ:
		return read_float(word, (double)VSMD_SHAKE_FREQ_MIN, (double)VSMD_SHAKE_FREQ_MAX,
		                  &command->shake_frequency);
	default:
		command->verb = verb;
		error = read_whole(word, 0, INT32_MAX, &number);
		if (error == VSMD_OK)
			command->shake_count = (uint32_t)number;
		return error;
	}
}

static enum vsmd_error read_shake(struct reader *reader, struct vsmd_command *command)
{
	struct word word;
	int seen = 0;

	if (!next_word(reader, &word))
		return VSMD_ERR_SYNTAX;
	if (is(word, "stop")) {
		command->verb = VSMD_SHAKE_STOP;
		return VSMD_OK;
	}
	if (!is(word, "start"))
		return VSMD_ERR_SYNTAX;
	while (next_word(reader, &word)) {
		enum vsmd_error error = read_shake_word(word, command, &seen);

		if (error != VSMD_OK)
			return error;
	}
	return seen == SHAKE_ALL ? VSMD_OK : VSMD_ERR_SYNTAX;
}

static enum vsmd_error read_setting(struct word word, struct vsmd_setting *setting)
{
	const char *equals = memchr(word.text, '=', word.length);
	size_t name = equals ? (size_t)(equals - word.text) : 0;
	struct word value;
	double number;
	bool whole;
	int param;

	if (!equals || name + 1 == word.length)
		return VSMD_ERR_SYNTAX;
	param = vsmd_param_find(word.text, name);
	if (param < 0)
		return VSMD_ERR_NAME;
	value = (struct word){ .text = equals + 1, .length = word.length - name - 1 };
	if (!parse_strict(value, &number, &whole))
		return VSMD_ERR_SYNTAX;
	setting->param = (enum vsmd_param)param;
	if (!vsmd_parse_value(vsmd_params[param].type, value.text, value.length, &setting->value))
		return VSMD_ERR_RANGE;
	return vsmd_param_in_range(setting->param, setting->value) ? VSMD_OK : VSMD_ERR_RANGE;
}

static enum vsmd_error read_cfg(struct reader *reader, struct vsmd_command *command,
                                struct vsmd_setting *settings, size_t capacity)
{
	struct word word;

	command->verb = VSMD_CFG_READ;
	command->settings = settings;
	while (next_word(reader, &word)) {
		enum vsmd_error error;

		command->verb = VSMD_CFG_WRITE;
		if (command->setting_count == capacity)
			return VSMD_ERR_SPACE;
		error = read_setting(word, &settings[command->setting_count]);
		if (error != VSMD_OK)
			return error;
		command->setting_count++;
	}
	return VSMD_OK;
}

/* "s3", "sv1", "nmos2": the verb and its port. */
static bool is_numbered(struct word word, const char *name, unsigned ports, uint8_t *port)
{
	size_t length = strlen(name);

	if (word.length != length + 1 || memcmp(word.text, name, length) != 0 ||
	    word.text[length] < '1' || word.text[length] > (char)('0' + ports))
		return false;
	*port = (uint8_t)(word.text[length] - '0');
	return true;
}

static enum vsmd_error read_verb(struct reader *reader, struct vsmd_command *command,
                                 struct vsmd_setting *settings, size_t capacity)
{
	struct word verb;
	struct word word;
	static const enum vsmd_verb plain[] = { VSMD_DEV, VSMD_STS,  VSMD_ENA,
		                                VSMD_OFF, VSMD_ECLR, VSMD_SAV };

	if (!next_word(reader, &verb))
		return VSMD_ERR_SYNTAX;
	if (is(verb, "cfg"))
		return read_cfg(reader, command, settings, capacity);
	if (is(verb, "mov")) {
		command->verb = VSMD_MOV;
		return read_move(reader, command);
	}
	if (is(verb, "pos") || is(verb, "rmv")) {
		command->verb = is(verb, "pos") ? VSMD_POS : VSMD_RMV;
		return read_move(reader, command);
	}
	if (is(verb, "stp") || is(verb, "org")) {
		command->verb = is(verb, "stp") ? VSMD_STP : VSMD_ORG;
		return read_value(reader, command);
	}
	if (is(verb, "zero")) {
		if (!next_word(reader, &word) || !(is(word, "start") || is(word, "stop")))
			return VSMD_ERR_SYNTAX;
		command->verb = is(word, "start") ? VSMD_ZERO_START : VSMD_ZERO_STOP;
		return VSMD_OK;
	}
	if (is(verb, "shake"))
		return read_shake(reader, command);
	if (is_numbered(verb, "s", 6, &command->port)) {
		command->verb = VSMD_SENSOR_OUT;
		if (!next_word(reader, &word) || !(is(word, "on") || is(word, "off")))
			return VSMD_ERR_SYNTAX;
		command->value = is(word, "on");
		return VSMD_OK;
	}
	if (is_numbered(verb, "sv", 3, &command->port)) {
		command->verb = VSMD_SV;
		return read_value(reader, command);
	}
	if (is_numbered(verb, "nmos", 3, &command->port)) {
		command->verb = VSMD_NMOS;
		return read_value(reader, command);
	}
	for (size_t i = 0; i < sizeof(plain) / sizeof(plain[0]); i++) {
		if (is(verb, fixed[plain[i]])) {
			command->verb = plain[i];
			return VSMD_OK;
		}
	}
	return VSMD_ERR_SYNTAX;
}

enum vsmd_error vsmd_serial_decode_command(const char *line, size_t length, bool rs485,
                                           struct vsmd_command *command,
                                           struct vsmd_setting *settings, size_t capacity)
{
	struct reader reader = { .text = line, .length = length };
	enum vsmd_error error;
	struct word word;

	*command = (struct vsmd_command){ .id = rs485 ? -2 : VSMD_SERIAL_NO_ID };
	if (length > 0 && line[length - 1] == '\r')
		reader.length--;
	if (rs485) {
		double id;

		if (!next_word(&reader, &word) || word.text[0] < '0' || word.text[0] > '9')
			return VSMD_ERR_SYNTAX;
		error = read_whole(word, 0, VSMD_SERIAL_ID_MAX, &id);
		if (error != VSMD_OK)
			return error;
		command->id = (int)id;
	}
	error = read_verb(&reader, command, settings, capacity);
	return error == VSMD_OK && next_word(&reader, &word) ? VSMD_ERR_SYNTAX : error;
}

/* --- parameter texts -------------------------------------------------------------------------- */

/* The text as a whole may be in quotation marks, as the document prints it, or each value. */
static void strip_quotes(struct word *word)
{
	while (word->length > 0 && word->text[0] == '"') {
		word->text++;
		word->length--;
	}
	while (word->length > 0 && word->text[word->length - 1] == '"')
		word->length--;
}

/* A comma between digits is a part of a number, and that number cannot be read. */
static bool is_separator(const char *text, size_t length, size_t at)
{
	if (text[at] != ',')
		return vsmd_is_blank(text[at]);
	return at + 1 == length || !(text[at + 1] >= '0' && text[at + 1] <= '9');
}

/* A parameter by its name as a drive writes it: in small letters, or in capitals. -1: unknown. */
static int find_param(struct word name)
{
	char small[NAME_MAX_LENGTH];

	if (name.length > sizeof(small))
		return -1;
	for (size_t i = 0; i < name.length; i++) {
		bool capital = name.text[i] >= 'A' && name.text[i] <= 'Z';

		small[i] = (char)(capital ? name.text[i] - 'A' + 'a' : name.text[i]);
	}
	return vsmd_param_find(small, name.length);
}

int vsmd_serial_next_param(const char *text, size_t length, size_t *cursor,
                           struct vsmd_setting *setting)
{
	struct word word;
	struct word value;
	const char *equals;
	int param;

	/* The text between two separators; of length 0 at the end. */
	while (*cursor < length && is_separator(text, length, *cursor))
		(*cursor)++;
	word.text = text + *cursor;
	while (*cursor < length && !is_separator(text, length, *cursor))
		(*cursor)++;
	word.length = (size_t)(text + *cursor - word.text);
	if (word.length == 0)
		return 0;
	equals = memchr(word.text, '=', word.length);
	if (!equals)
		return 2;
	value.text = equals + 1;
	value.length = (size_t)(word.text + word.length - value.text);
	word.length = (size_t)(equals - word.text);
	strip_quotes(&word);
	strip_quotes(&value);
	param = find_param(word);
	if (param < 0)
		return 2;
	setting->param = (enum vsmd_param)param;
	return vsmd_parse_value(vsmd_params[param].type, value.text, value.length,
	                        &setting->value) ?
	               1 :
	               2;
}

int vsmd_serial_format_params(const union db_value values[VSMD_PARAM_COUNT], char *text,
                              size_t size)
{
	struct writer writer = { .text = text, .size = size };

	for (size_t i = 0; i < VSMD_SERIAL_PARAM_COUNT; i++) {
		if (i > 0)
			put(&writer, " ");
		put(&writer, vsmd_params[i].name);
		put(&writer, "=");
		put_value(&writer, vsmd_params[i].type, values[i]);
	}
	return writer.error ? writer.error : (int)writer.length;
}
