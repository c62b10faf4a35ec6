/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/config_section.h"

#include "codec/can.h"
#include "codec/servo_can.h"
#include "codec/vsmd_serial.h"
#include "codec/xyza.h"
#include "sim/vsmd_temper.h"

#include <errno.h>
#include <limits.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define TIME_MAX_US 10000000
#define TIME_MAX_MS 60000

enum key_type { KEY_TEXT, KEY_WORD, KEY_LIST, KEY_WHOLE, KEY_REAL, KEY_FLAG };

struct sim_key {
	const char *name;
	enum key_type type;
	const char *preset; /* null: no text, an empty list */
	const char *words;  /* for WORD: with | between them */
	long min;           /* for WHOLE */
	long max;
};

#define TEXT(n, p)                         \
	{                                  \
		n, KEY_TEXT, p, NULL, 0, 0 \
	}
#define WORD(n, p, w)                   \
	{                               \
		n, KEY_WORD, p, w, 0, 0 \
	}
#define LIST(n)                               \
	{                                     \
		n, KEY_LIST, NULL, NULL, 0, 0 \
	}
#define WHOLE(n, p, low, high)                   \
	{                                        \
		n, KEY_WHOLE, p, NULL, low, high \
	}
#define REAL(n, p)                         \
	{                                  \
		n, KEY_REAL, p, NULL, 0, 0 \
	}
#define FLAG(n, p)                         \
	{                                  \
		n, KEY_FLAG, p, NULL, 0, 0 \
	}
#define END                                      \
	{                                        \
		NULL, KEY_TEXT, NULL, NULL, 0, 0 \
	}

/* clang-format off */
static const struct sim_key BUS_KEYS[] = {
	WORD ("protocol",            "vsmd-serial", "vsmd-serial|vsmd-can|servo-can|xyza"),
	TEXT ("device",              "pty"),
	TEXT ("link",                NULL),
	WHOLE("baud",                "115200", 2400, 921600),
	FLAG ("follow-host",         "false"),
	WORD ("twins",               "none", "none|together|shifted|in-turn"),
	WORD ("line",                "rs485", "rs485|rs232"),
	WHOLE("latency-us",          "800", 0, TIME_MAX_US),
	WHOLE("turnaround-us",       "0", 0, TIME_MAX_US),
	WHOLE("line-hold-us",        "0", 0, TIME_MAX_US),
	WHOLE("reply-id",            "1", 0, VSMD_SERIAL_ID_MAX),
	/* CAN. */
	WORD ("transport",           "slcan", "slcan|socketcan"),
	TEXT ("interface",           NULL),
	WHOLE("bitrate",             "100000", 10000, 1000000),
	WORD ("frames",              "extended", "extended|standard"),
	WHOLE("output-base",         "1", 0, 1),
	/* What the servos' document leaves open. */
	WHOLE("ack-base",            "1", 0, DB_CAN_STANDARD_MASK),
	FLAG ("padded",              "false"),
	WHOLE("command-word-base",   "0", 0, DB_CAN_STANDARD_MASK),
	WHOLE("command-word-length", "4", 2, DB_CAN_DATA_MAX),
	WHOLE("command-word-0-at",   "0", 0, DB_CAN_DATA_MAX - 2),
	WHOLE("command-word-1-at",   "-1", -1, DB_CAN_DATA_MAX - 2),
	WHOLE("command-word-ack",    "7", 0, UINT8_MAX),
	WHOLE("command-word-fixed",  "0", LONG_MIN, LONG_MAX),
	WHOLE("command-word-1-base", "0", 0, DB_CAN_STANDARD_MASK),
	WHOLE("command-word-1-length", "2", 2, DB_CAN_DATA_MAX),
	WHOLE("command-word-1-fixed", "0", LONG_MIN, LONG_MAX),
	WHOLE("command-word-1-ack",  "8", 0, UINT8_MAX),
	WHOLE("position-slot",       "0", 0, SERVO_CAN_SLOT_MAX),
	WHOLE("position-slot-base",  "0", 0, DB_CAN_STANDARD_MASK),
	WHOLE("position-slot-ack",   "6", 0, UINT8_MAX),
	WHOLE("move-frame-base",     "0", 0, DB_CAN_STANDARD_MASK),
	WHOLE("move-frame-length",   "4", 2, DB_CAN_DATA_MAX),
	WHOLE("move-frame-at",       "0", 0, DB_CAN_DATA_MAX - 2),
	WHOLE("move-frame-bytes",    "4", 2, DB_CAN_DATA_MAX),
	WORD ("move-frame-order",    "high-first", "high-first|low-first"),
	WHOLE("move-frame-fixed",    "0", LONG_MIN, LONG_MAX),
	WHOLE("move-frame-ack",      "3", 0, UINT8_MAX),
	TEXT ("flash",               NULL),
	LIST ("fault"),
	END
};

/* For drives of all families. */
static const struct sim_key DRIVE_KEYS[] = {
	TEXT ("bus",                 NULL),
	WHOLE("address",             "1", LONG_MIN, LONG_MAX),
	/* On a serial line, in addition to the bus's latency-us and turnaround-us. */
	WHOLE("own-latency-us",      "0", 0, TIME_MAX_US),
	WHOLE("own-turnaround-us",   "0", 0, TIME_MAX_US),
	/* VSMD. */
	TEXT ("identity",            "VSMD113_025T-1.0.008.170428"),
	WORD ("model",               "025T", "010T|025T|045T|080T"),
	FLAG ("closed-loop",         "false"),
	FLAG ("external",            "false"),
	REAL ("max-current",         "2.5"),
	REAL ("travel-min",          "-1e9"),
	REAL ("travel-max",          "1e9"),
	REAL ("start",               "0.0"),
	WORD ("handshake",           "", "|dev|any"),
	FLAG ("handshake-kept",      "false"),
	WHOLE("handshake-lapses-ms", "0", 0, TIME_MAX_MS),
	WHOLE("power-delay-ms",      "0", 0, TIME_MAX_MS),
	WHOLE("standing-delay-ms",   "0", 0, TIME_MAX_MS),
	WHOLE("motion-delay-ms",     "0", 0, TIME_MAX_MS),
	WORD ("refusal",             "", "|kept|once|cleared"),
	FLAG ("clamps",              "false"),
	WHOLE("rests-off",           "0", -1000, 1000),
	WHOLE("trembles",            "0", 0, 1000),
	WORD ("speed",               "signed", "signed|unsigned|none"),
	FLAG ("keeps-position",      "false"),
	FLAG ("coasts",              "false"),
	FLAG ("homing-bit-kept",     "false"),
	FLAG ("hides-outputs",       "false"),
	FLAG ("ignores-broadcast",   "false"),
	WORD ("settles",             "", "|power-up|after-answer|at-once"),
	WORD ("text",                "plain", "plain|nul|crlf|quoted"),
	WORD ("numbers",             "plain", "plain|exponent|quoted"),
	WORD ("parameters",          "told", "told|refused|silent"),
	FLAG ("capitals",            "false"),
	FLAG ("commas",              "false"),
	WHOLE("text-length",         "0", 0, SIM_VSMD_TEXT_MAX),
	LIST ("lacks"),
	WORD ("answers",             "pairs", "pairs|padded|singles"),
	WORD ("replies",             "host", "host|host-0|broadcast|standard"),
	WHOLE("read-max",            "0", 0, 64),
	FLAG ("hides-identity",      "false"),
	/* Servos. */
	WORD ("mode",                "position", "position|speed|current"),
	FLAG ("sync",                "false"),
	WHOLE("report-position-ms",  "100", 0, TIME_MAX_MS),
	WHOLE("report-motion-ms",    "100", 0, TIME_MAX_MS),
	WHOLE("report-health-ms",    "1000", 0, TIME_MAX_MS),
	REAL ("load",                "0.0"),
	REAL ("inertia",             "1e-4"),
	WORD ("fault-power",         "off", "off|kept|resumes"),
	WORD ("demand",              "position", "position|kept|triggered|moved"),
	WORD ("reached-bit",         "position", "position|profile"),
	WORD ("trigger",             "works", "works|ignored"),
	WORD ("setpoints",           "always", "always|in-mode"),
	WORD ("speed-sign",          "signed", "signed|bits"),
	TEXT ("status-places",       "0123456789abcdef"),
	WHOLE("status-inverted",     "0", 0, UINT16_MAX),
	WHOLE("moving-bit",          "-1", -1, 15),
	FLAG ("mirrored",            "false"),
	WORD ("moves",               "absolute", "absolute|relative"),
	REAL ("demand-step",         "1"),
	REAL ("move-step",           "1"),
	REAL ("speed-step",          "1"),
	REAL ("setpoint-step",       "1"),
	REAL ("current-step",        "0.1"),
	REAL ("current-setpoint-step", "0.1"),
	FLAG ("stray-acks",          "false"),
	FLAG ("counts-anew",         "false"),
	WORD ("answer-length",       "documented", "documented|eight|mixed|short"),
	REAL ("zero-speed-rpm",      "1.0"),
	REAL ("dither",              "0.0"),
	WHOLE("ack-latency-us",      "0", 0, TIME_MAX_US),
	WHOLE("power-ms",            "5", 0, TIME_MAX_MS),
	/* XYZA. */
	WHOLE("axes",                "4", 1, XYZA_AXIS_COUNT),
	WHOLE("programs",            "8", 1, UINT8_MAX),
	WHOLE("program-steps",       "300", 1, XYZA_PROGRAM_STEP_MAX),
	WHOLE("step-ms",             "500", 1, TIME_MAX_MS),
	WORD ("answer-mark",         "0c", "0c|0a"),
	WORD ("failure-code",        "ab", "ab|bb"),
	FLAG ("echo-a4",             "false"),
	FLAG ("negative-zero",       "true"),
	FLAG ("amount-clears-sign",  "false"),
	FLAG ("acknowledges-all",    "false"),
	FLAG ("jogs-from-stand",     "false"),
	FLAG ("second-stop-ends",    "false"),
	FLAG ("ordered-speeds",      "false"),
	FLAG ("latches-speed",       "false"),
	FLAG ("takes-any",           "false"),
	WHOLE("idle-state",          "0", 0, UINT8_MAX),
	WHOLE("braking-ms",          "0", 0, TIME_MAX_MS),
	FLAG ("answers-as-host",     "false"),
	LIST ("ignores"),
	LIST ("sensor"),
	LIST ("set"),
	LIST ("fault"),
	END
};
/* clang-format on */

/* Null for an unknown section. */
static const struct sim_key *find_keys(const char *section)
{
	if (strcmp(section, "bus") == 0)
		return BUS_KEYS;
	return strcmp(section, "drive") == 0 ? DRIVE_KEYS : NULL;
}

/* Null when there is none of this name. */
static const struct sim_key *find_key(const struct sim_key *keys, const char *name)
{
	for (; keys->name; keys++) {
		if (strcmp(keys->name, name) == 0)
			return keys;
	}
	return NULL;
}

/* --- the whole text --------------------------------------------------------------------------- */

/* False when it is no flag. */
static bool parse_flag(const char *text, bool *flag)
{
	static const char *const words[] = { "false", "true", "no", "yes", "off", "on" };

	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		if (strcasecmp(text, words[i]) != 0)
			continue;
		*flag = i % 2 == 1;
		return true;
	}
	return false;
}

static void check_type(const struct db_reader_key *given, const struct sim_key *key,
                       struct db_messages *messages)
{
	const char *what = NULL, *right = NULL;
	char *end;
	bool flag;

	if (key->type == KEY_LIST)
		return;
	errno = 0;
	if (given->list) {
		what = "more than one";
		right = "; KEY = VALUE is right";
	} else if (key->type == KEY_WHOLE) {
		(void)strtol(given->values, &end, 0);
		what = *end != '\0' ? "invalid integer" : errno != 0 ? "integer" : NULL;
		right = *end != '\0' ? "; a whole number is right" :
		                       " is out of range; a smaller one is right";
	} else if (key->type == KEY_REAL) {
		(void)strtod(given->values, &end);
		what = *end != '\0' || errno != 0 ? "invalid floating point" : NULL;
		right = "; a number is right";
	} else if (key->type == KEY_FLAG && !parse_flag(given->values, &flag)) {
		what = "invalid boolean";
		right = "; true or false is right";
	}
	if (what)
		db_messages_add_error(messages, given->line, "%s value for option '%s'%s", what,
		                      key->name, right);
}

/* The names that can stand there, each after a space; the caller frees them. Null: no memory. */
static char *list_names(const struct sim_key *keys)
{
	char *names = NULL;
	size_t length;
	FILE *out = open_memstream(&names, &length);

	if (!out)
		return NULL;
	if (!keys)
		fputs(" bus drive", out);
	for (; keys && keys->name; keys++)
		fprintf(out, " %s", keys->name);
	if (fclose(out) == 0)
		return names;
	free(names);
	return NULL;
}

void sim_section_check_all(const struct db_reader *reader, struct db_messages *messages)
{
	for (size_t i = 0; i < reader->section_count; i++) {
		const struct db_reader_section *section = &reader->sections[i];

		if (!find_keys(section->name))
			db_messages_add_error(messages, section->line,
			                      "no such option '%s'; known here: bus drive",
			                      section->name);
		else if (section->title[0] == '\0')
			db_messages_add_error(
				messages, section->line,
				"missing title for section '%s'; SECTION NAME { ... } is right",
				section->name);
		else if (db_reader_find_section(reader, section->name, section->title) != i)
			db_messages_add_error(
				messages, section->line,
				"found duplicate title '%s'; every bus and drive needs a name of "
				"its own",
				section->title);
	}
	for (size_t i = 0; i < reader->key_count; i++) {
		const struct db_reader_key *given = &reader->keys[i];
		const struct sim_key *keys, *key;
		char *names;

		keys = given->section == DB_READER_NO_SECTION ?
		               NULL :
		               find_keys(reader->sections[given->section].name);
		key = keys ? find_key(keys, given->name) : NULL;
		if (key)
			check_type(given, key, messages);
		/* Keys of an unknown section are not checked. */
		if (key || (!keys && given->section != DB_READER_NO_SECTION))
			continue;
		names = list_names(keys);
		db_messages_add_error(messages, given->line, "no such option '%s'; known here:%s",
		                      given->name, names ? names : " (out of memory)");
		free(names);
	}
}

struct sim_section sim_section_open(const struct db_reader *reader, struct db_messages *messages,
                                    size_t index)
{
	return (struct sim_section){
		.reader = reader,
		.messages = messages,
		.keys = find_keys(reader->sections[index].name),
		.index = index,
		.title = reader->sections[index].title,
	};
}

/* --- one value -------------------------------------------------------------------------------- */

static const struct db_reader_key *find_given(const struct sim_section *section, const char *name)
{
	return db_reader_find_key(section->reader, section->index, name);
}

void sim_section_refuse(const struct sim_section *section, const char *name, const char *format,
                        ...)
{
	const struct db_reader_key *given = name ? find_given(section, name) : NULL;
	unsigned line = given ? given->line : section->reader->sections[section->index].line;
	va_list arguments;
	char *text;

	va_start(arguments, format);
	if (vasprintf(&text, format, arguments) < 0)
		text = NULL;
	va_end(arguments);
	db_messages_add_error(section->messages, line, "%s", text ? text : "out of memory");
	free(text);
}

const char *sim_section_text(const struct sim_section *section, const char *name)
{
	const struct db_reader_key *given = find_given(section, name);

	return given ? given->values : find_key(section->keys, name)->preset;
}

static void refuse_range(const struct sim_section *section, const char *name, long value, long min,
                         long max)
{
	sim_section_refuse(section, name, "%s = %ld is out of range; %ld to %ld is right", name,
	                   value, min, max);
}

long sim_section_whole(const struct sim_section *section, const char *name)
{
	const struct sim_key *key = find_key(section->keys, name);
	long value = strtol(sim_section_text(section, name), NULL, 0);

	if (value >= key->min && value <= key->max)
		return value;
	refuse_range(section, name, value, key->min, key->max);
	return strtol(key->preset, NULL, 0);
}

bool sim_section_check_range(const struct sim_section *section, const char *name, long min,
                             long max)
{
	long value = sim_section_whole(section, name);

	if (value >= min && value <= max)
		return true;
	refuse_range(section, name, value, min, max);
	return false;
}

double sim_section_real(const struct sim_section *section, const char *name)
{
	return strtod(sim_section_text(section, name), NULL);
}

bool sim_section_flag(const struct sim_section *section, const char *name)
{
	bool flag = false;

	(void)parse_flag(sim_section_text(section, name), &flag);
	return flag;
}

/* True if it is one of the key's words, and which one. */
static bool find_word(const struct sim_key *key, const char *text, unsigned *position)
{
	const char *word = key->words;

	for (*position = 0;; (*position)++) {
		size_t length = strcspn(word, "|");

		if (strlen(text) == length && memcmp(word, text, length) == 0)
			return true;
		if (word[length] == '\0')
			return false;
		word += length + 1;
	}
}

unsigned sim_section_word(const struct sim_section *section, const char *name)
{
	const struct sim_key *key = find_key(section->keys, name);
	const char *text = sim_section_text(section, name);
	char known[128] = "";
	unsigned position;

	if (find_word(key, text, &position))
		return position;
	for (const char *at = key->words; *at; at++) {
		size_t used = strlen(known);

		snprintf(known + used, sizeof(known) - used, *at == '|' ? ", " : "%c", *at);
	}
	sim_section_refuse(section, name, "%s = \"%s\" is unknown; one of these is right: %s", name,
	                   text, known);
	(void)find_word(key, key->preset, &position);
	return position;
}

const char *sim_section_next(const struct sim_section *section, const char *name, const char *text)
{
	const struct db_reader_key *given = find_given(section, name);
	const char *next;

	if (!given || given->count == 0)
		return NULL;
	next = text ? text + strlen(text) + 1 : given->values;
	return next < given->values + given->size ? next : NULL;
}

size_t sim_section_length(const struct sim_section *section, const char *name)
{
	const struct db_reader_key *given = find_given(section, name);

	return given ? given->count : 0;
}
