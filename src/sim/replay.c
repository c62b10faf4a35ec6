/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/replay.h"

#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define FRAME_MAX 2048
/* An incomplete question is dropped after this. */
#define PATIENCE (50 * DB_NS_PER_MS)
#define ANSWERS_MAX 16
#define NOWHERE SIZE_MAX

/* A line of the trace with bytes. */
struct frame {
	unsigned line;
	bool question; /* else an answer to the last question before */
	bool asked;    /* for a question: it has been asked in its turn */
	db_time after; /* for an answer: time after the question */
	size_t length;
	const uint8_t *bytes;
};

/* On its way to the host. */
struct answer {
	db_time due;
	size_t frame;
	size_t sent; /* number of its bytes */
};

struct sim_replay {
	FILE *log;
	const char *file;
	sim_trace_fn *trace; /* null: none */
	void *context;
	struct frame *frames;
	size_t count;
	uint8_t *bytes;
	size_t next;        /* index of the expected question; `count`: no more */
	size_t reported_at; /* index where an unexpected question was reported */
	unsigned in_turn;
	unsigned out_of_turn;
	unsigned unknown;

	uint8_t input[FRAME_MAX];
	size_t input_length;
	db_time input_until;
	struct answer answers[ANSWERS_MAX];
	size_t answer_count;
	struct sim_faults faults;
};

__attribute__((format(printf, 3, 4))) static void report(const struct sim_replay *replay,
                                                         unsigned line, const char *format, ...)
{
	va_list arguments;

	fprintf(replay->log, "%s:%u: ", replay->file, line);
	va_start(arguments, format);
	vfprintf(replay->log, format, arguments);
	va_end(arguments);
	fputc('\n', replay->log);
	(void)fflush(replay->log);
}

/* --- the file --------------------------------------------------------------------------------- */

static int digit(char character)
{
	const char *const digits = "0123456789ABCDEF";
	const char *found = strchr(digits, toupper((unsigned char)character));

	return character != '\0' && found ? (int)(found - digits) : -1;
}

/* "31 20 73": the number of bytes; -1 for another text. */
static int read_bytes(const char *text, const char *end, uint8_t *bytes)
{
	int count = 0;

	for (;;) {
		while (text < end && isspace((unsigned char)*text))
			text++;
		if (text == end)
			return count;
		if (end - text < 2 || digit(text[0]) < 0 || digit(text[1]) < 0 ||
		    (end - text > 2 && !isspace((unsigned char)text[2])) || count == FRAME_MAX)
			return -1;
		bytes[count++] = (uint8_t)(digit(text[0]) * 16 + digit(text[1]));
		text += 2;
	}
}

/* Time of day, in ns. False: it is none. */
static bool read_time(const char *text, const char *end, db_time *time)
{
	int hours;
	int minutes;
	int seconds;
	int micros;
	int used = 0;

	if (end - text < 15 ||
	    sscanf(text, "%2d:%2d:%2d.%6d%n", &hours, &minutes, &seconds, &micros, &used) != 4 ||
	    used != 15 || hours < 0 || minutes < 0 || seconds < 0 || micros < 0)
		return false;
	*time = ((db_time)(hours * 60 + minutes) * 60 + seconds) * DB_NS_PER_S +
	        (db_time)micros * DB_NS_PER_US;
	return true;
}

/* The mistake in a line, in words; null: none. `store` receives its bytes. */
static const char *read_line(struct sim_replay *replay, unsigned line, const char *text,
                             const char *end, db_time *asked, uint8_t *store)
{
	struct frame *frame = &replay->frames[replay->count];
	const char *stroke = memrchr(text, '|', (size_t)(end - text));
	db_time time;
	int length;
	char direction;

	if (!read_time(text, end, &time) || end - text < 18 || text[15] != ' ' || text[17] != ' ')
		return "right is a time of day and a direction, such as 10:20:30.123456 >";
	direction = text[16];
	if (direction == '!' || direction == '=')
		return NULL;
	if (direction != '>' && direction != '<')
		return "right is one of > < ! = behind the time";
	if (!stroke)
		return "right are bytes behind a stroke, such as | 31 20 73";
	length = read_bytes(stroke + 1, end, store);
	if (length <= 0)
		return "right are bytes of two hexadecimal digits behind the stroke; a trace of "
		       "CAN cannot be replayed";
	/* Answers to questions from before the trace. */
	if (direction == '<' && *asked < 0)
		return NULL;
	*frame = (struct frame){
		.line = line, .question = direction == '>', .length = (size_t)length, .bytes = store
	};
	if (frame->question)
		*asked = time;
	else
		frame->after = time >= *asked ? time - *asked : time + 86400 * DB_NS_PER_S - *asked;
	replay->count++;
	return NULL;
}

struct sim_replay *sim_replay_parse(const char *text, const char *file, FILE *log)
{
	struct sim_replay *replay = calloc(1, sizeof(*replay));
	size_t size = strlen(text);
	db_time asked = -1;
	size_t used = 0;
	unsigned line = 1;

	if (!replay)
		return NULL;
	replay->log = log;
	replay->file = file;
	/* A line with a byte has more than twenty characters. */
	replay->frames = calloc(size / 20 + 1, sizeof(*replay->frames));
	replay->bytes = malloc(size / 2 + FRAME_MAX);
	if (!replay->frames || !replay->bytes)
		goto fail;
	for (const char *next; *text != '\0'; text = next, line++) {
		const char *end = strchr(text, '\n');
		const char *wrong;

		end = end ? end : text + strlen(text);
		next = *end ? end + 1 : end;
		if (*text == '#' || text == end)
			continue;
		wrong = read_line(replay, line, text, end, &asked, replay->bytes + used);
		if (wrong) {
			report(replay, line, "%s", wrong);
			goto fail;
		}
		if (replay->count > 0)
			used = (size_t)(replay->frames[replay->count - 1].bytes - replay->bytes) +
			       replay->frames[replay->count - 1].length;
	}
	if (replay->count == 0) {
		report(replay, line, "nothing is asked in this file");
		goto fail;
	}
	replay->reported_at = NOWHERE;
	return replay;
fail:
	sim_replay_free(replay);
	return NULL;
}

struct sim_replay *sim_replay_load(const char *path, FILE *log, sim_trace_fn *trace, void *context)
{
	struct sim_replay *replay = NULL;
	FILE *file = fopen(path, "re");
	char *text = NULL;
	size_t size = 0;
	ssize_t length = file ? getdelim(&text, &size, '\0', file) : -1;

	if (length > 0 || (file && feof(file)))
		replay = sim_replay_parse(length > 0 ? text : "", path, log);
	else
		fprintf(log, "%s: %s\n", path, strerror(errno));
	free(text);
	if (file)
		(void)fclose(file);
	if (replay) {
		replay->trace = trace;
		replay->context = context;
	}
	return replay;
}

void sim_replay_free(void *wire)
{
	struct sim_replay *replay = wire;

	if (!replay)
		return;
	free(replay->frames);
	free(replay->bytes);
	free(replay);
}

/* --- questions -------------------------------------------------------------------------------- */

/* The first question at or after this index; `count` when there is none. */
static size_t question_from(const struct sim_replay *replay, size_t at)
{
	while (at < replay->count && !replay->frames[at].question)
		at++;
	return at;
}

static bool begins_with(const struct sim_replay *replay, size_t at)
{
	const struct frame *frame = &replay->frames[at];

	return frame->length <= replay->input_length &&
	       memcmp(frame->bytes, replay->input, frame->length) == 0;
}

/* True if the received bytes may be the beginning of a question. */
static bool may_go_on(const struct sim_replay *replay)
{
	for (size_t i = question_from(replay, 0); i < replay->count;
	     i = question_from(replay, i + 1)) {
		if (replay->frames[i].length > replay->input_length &&
		    memcmp(replay->frames[i].bytes, replay->input, replay->input_length) == 0)
			return true;
	}
	return false;
}

/* Reports an unexpected question, once for each expected one. */
static void report_mismatch(struct sim_replay *replay, bool known, const uint8_t *bytes,
                            size_t length)
{
	bool over = replay->next >= replay->count;
	char text[3 * 32 + 4];
	size_t used = 0;

	if (known && (over || replay->reported_at == replay->next))
		return;
	if (known)
		replay->reported_at = replay->next;
	for (size_t i = 0; i < length && i < 32; i++)
		used += (size_t)snprintf(text + used, sizeof(text) - used, " %02X", bytes[i]);
	if (length > 32)
		snprintf(text + used, sizeof(text) - used, "...");
	report(replay,
	       over ? replay->frames[replay->count - 1].line : replay->frames[replay->next].line,
	       known ? "another question came before:%s" :
	               "a question came that is not in this file:%s",
	       text);
}

static void drop_input(struct sim_replay *replay, size_t length, db_time now)
{
	if (replay->trace)
		replay->trace(replay->context, now, '>', replay->input, length);
	replay->input_length -= length;
	memmove(replay->input, replay->input + length, replay->input_length);
}

/* False: there is no complete question left. */
static bool take_question(struct sim_replay *replay, db_time now)
{
	size_t question = replay->next;
	bool in_turn = question < replay->count && begins_with(replay, question);

	if (replay->input_length == 0)
		return false;
	if (!in_turn) {
		/* The same question elsewhere: the last one before the expected one, else the first
		 * one after it. */
		question = NOWHERE;
		for (size_t i = question_from(replay, 0);
		     i < replay->count && (i <= replay->next || question == NOWHERE);
		     i = question_from(replay, i + 1)) {
			if (begins_with(replay, i))
				question = i;
		}
	}
	if (question == NOWHERE) {
		if (may_go_on(replay))
			return false;
		report_mismatch(replay, false, replay->input, replay->input_length);
		replay->unknown++;
		drop_input(replay, replay->input_length, now);
		return false;
	}
	if (in_turn) {
		replay->in_turn++;
	} else {
		report_mismatch(replay, true, replay->input, replay->frames[question].length);
		replay->out_of_turn++;
	}
	/* Its answers are the lines up to the next question. */
	for (size_t i = question + 1; i < replay->count && !replay->frames[i].question; i++) {
		if (replay->answer_count == ANSWERS_MAX)
			break;
		replay->answers[replay->answer_count++] =
			(struct answer){ .due = now + replay->frames[i].after, .frame = i };
	}
	drop_input(replay, replay->frames[question].length, now);
	/* The first question not yet asked is expected next. */
	replay->frames[question].asked = true;
	while (replay->next < replay->count && replay->frames[replay->next].asked)
		replay->next = question_from(replay, replay->next + 1);
	return true;
}

/* --- as a wire -------------------------------------------------------------------------------- */

static void receive(void *wire, const uint8_t *bytes, size_t length, db_time now)
{
	struct sim_replay *replay = wire;

	if (replay->input_length > 0 && now >= replay->input_until) {
		report_mismatch(replay, false, replay->input, replay->input_length);
		replay->unknown++;
		drop_input(replay, replay->input_length, now);
	}
	while (length > 0) {
		size_t room = sizeof(replay->input) - replay->input_length;
		size_t take = length < room ? length : room;

		memcpy(replay->input + replay->input_length, bytes, take);
		replay->input_length += take;
		bytes += take;
		length -= take;
		while (take_question(replay, now))
			;
		/* Longer than any question. */
		if (replay->input_length == sizeof(replay->input))
			replay->input_length = 0;
	}
	replay->input_until = now + PATIENCE;
}

static size_t run(void *wire, db_time now, uint8_t *out, size_t size)
{
	struct sim_replay *replay = wire;

	for (size_t i = 0; i < replay->answer_count; i++) {
		struct answer *due = &replay->answers[i];
		const struct frame *frame = &replay->frames[due->frame];
		size_t length = frame->length - due->sent;

		if (now < due->due)
			continue;
		length = length < size ? length : size;
		memcpy(out, frame->bytes + due->sent, length);
		if (replay->trace)
			replay->trace(replay->context, now, '<', out, length);
		due->sent += length;
		if (due->sent == frame->length) {
			replay->answer_count--;
			memmove(due, due + 1, (replay->answer_count - i) * sizeof(*due));
		}
		return length;
	}
	return 0;
}

static db_time next(void *wire)
{
	const struct sim_replay *replay = wire;
	db_time first = DB_TIME_NEVER;

	for (size_t i = 0; i < replay->answer_count; i++)
		first = replay->answers[i].due < first ? replay->answers[i].due : first;
	return first;
}

static struct sim_faults *faults(void *wire)
{
	struct sim_replay *replay = wire;

	return &replay->faults;
}

static void describe(void *wire, char *text, size_t size)
{
	const struct sim_replay *replay = wire;

	snprintf(text, size, "in-turn=%u out-of-turn=%u unknown=%u complete=%d", replay->in_turn,
	         replay->out_of_turn, replay->unknown, sim_replay_is_complete(replay));
}

const struct sim_wire_ops sim_replay_ops = {
	.receive = receive,
	.run = run,
	.next = next,
	.faults = faults,
	.describe = describe,
	.free = sim_replay_free,
};

/* --- results ---------------------------------------------------------------------------------- */

bool sim_replay_is_complete(const struct sim_replay *replay)
{
	return replay->next == replay->count && replay->unknown == 0;
}

void sim_replay_report(const struct sim_replay *replay)
{
	fprintf(replay->log, "%s: %u questions in turn, %u out of turn, %u unknown; ", replay->file,
	        replay->in_turn, replay->out_of_turn, replay->unknown);
	if (replay->next < replay->count)
		fprintf(replay->log, "line %u was not asked for\n",
		        replay->frames[replay->next].line);
	else
		fputs("all of it was replayed\n", replay->log);
	(void)fflush(replay->log);
}
