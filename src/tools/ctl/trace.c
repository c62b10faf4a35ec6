/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/pcapng.h"
#include "capture/trace_text.h"
#include "client/clock.h"
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/value.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PCAPNG ".pcapng"

struct tracing {
	struct db_ctl *ctl;
	const json_t *bus;
	FILE *out;
	bool pcapng;
	bool headed;
	json_int_t records;
	json_int_t missed;
	struct db_capture_pcapng frames; /* what comes before the next one of a file */
	struct db_capture_questions questions;
	char words[DB_CAPTURE_TRACE_LINE];
	char line[DB_CAPTURE_TRACE_LINE];
	bool ended;
	enum db_ctl_status status;
};

/* --- output of records ------------------------------------------------------------------------ */

/* Of its line on a terminal. */
static enum db_ctl_colour colour_of(const json_t *record)
{
	const char *kind = db_words_text(record, "kind");
	static const char *const red[] = { "unanswered", "bad" };
	static const char *const yellow[] = { "event", "late", "stray", "garbage" };

	for (size_t i = 0; i < sizeof(red) / sizeof(red[0]); i++) {
		if (strcmp(kind, red[i]) == 0)
			return DB_CTL_RED;
	}
	for (size_t i = 0; i < sizeof(yellow) / sizeof(yellow[0]); i++) {
		if (strcmp(kind, yellow[i]) == 0)
			return DB_CTL_YELLOW;
	}
	return DB_CTL_PLAIN;
}

static void write_text(struct tracing *tracing, const json_t *record)
{
	bool coloured = tracing->ctl->colour && tracing->out == stdout;
	enum db_ctl_colour colour = colour_of(record);

	if (!tracing->headed) {
		db_capture_trace_write_head(tracing->bus,
		                            json_integer_value(json_object_get(record, "time_us")),
		                            tracing->line, sizeof(tracing->line));
		fputs(tracing->line, tracing->out);
		tracing->headed = true;
	}
	db_capture_trace_write_line(record, tracing->words, tracing->line, sizeof(tracing->line));
	fprintf(tracing->out, "%s%s%s\n", db_ctl_colour_begin(coloured, colour), tracing->line,
	        db_ctl_colour_end(coloured, colour));
}

static void take_records(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct tracing *tracing = data;
	json_int_t missed = json_integer_value(json_object_get(parameters, "missed"));
	size_t i;
	const json_t *record;

	tracing->ended = !more;
	if (error) {
		tracing->status = db_ctl_fail(tracing->ctl, error);
		return;
	}
	tracing->missed += missed;
	tracing->frames.missed += missed;
	if (missed > 0 && !tracing->pcapng && !tracing->ctl->json)
		fprintf(tracing->out, "# %lld records are missing here\n", (long long)missed);
	json_array_foreach(json_object_get(parameters, "records"), i, record)
	{
		tracing->records++;
		db_capture_trace_take(&tracing->questions, record, tracing->words,
		                      sizeof(tracing->words));
		if (tracing->pcapng)
			(void)db_capture_pcapng_take(&tracing->frames, record, tracing->words,
			                             tracing->out);
		else if (!tracing->ctl->json)
			write_text(tracing, record);
		else if (json_dumpf(record, tracing->out, JSON_COMPACT) == 0)
			fputc('\n', tracing->out);
	}
	(void)fflush(tracing->out);
}

/* --- choice of the trace ---------------------------------------------------------------------- */

/* The kept traces as an array that the caller frees; NULL: the reason is printed. */
static json_t *read_kept(struct db_ctl *ctl, enum db_ctl_status *status)
{
	json_t *answer = db_ctl_call(ctl, "Traces", NULL, DB_CTL_TIMEOUT_MS, status);
	json_t *kept = json_incref(json_object_get(answer, "kept"));

	json_decref(answer);
	return kept;
}

/* The trace of --kept: its number, and its bus unless one was given. 0: the reason is printed. */
static json_int_t choose_kept(struct tracing *tracing, const char **bus)
{
	struct db_ctl *ctl = tracing->ctl;
	json_t *kept = read_kept(ctl, &tracing->status);
	bool last = strcmp(ctl->kept, "last") == 0;
	char *end = NULL;
	json_int_t number = last ? 0 : strtoll(ctl->kept, &end, 10);
	json_int_t found = 0;
	size_t i;
	const json_t *one;

	if (!kept)
		return 0;
	json_array_foreach(kept, i, one)
	{
		json_int_t this_number = json_integer_value(json_object_get(one, "number"));

		if ((*bus && strcmp(*bus, db_words_text(one, "bus")) != 0) ||
		    (!last && (*end != '\0' || number != this_number)))
			continue;
		found = this_number;
		tracing->bus = db_words_look_up(json_object_get(ctl->description, "buses"),
		                                db_words_text(one, "bus"));
	}
	json_decref(kept);
	if (found == 0 && *bus)
		tracing->status = db_ctl_complain(ctl, DB_CTL_USAGE,
		                                  DB_CLIENT_SERVICE "NoSuchTrace",
		                                  "no trace \"%s\" of bus %s was kept; "
		                                  "drivebridgectl traces lists those that were",
		                                  ctl->kept, *bus);
	else if (found == 0)
		tracing->status = db_ctl_complain(
			ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "NoSuchTrace",
			"no trace \"%s\" was kept; drivebridgectl traces lists those that were",
			ctl->kept);
	else if (!tracing->bus)
		tracing->status = db_ctl_complain(
			ctl, DB_CTL_NO, DB_CLIENT_SERVICE "NoSuchBus",
			"the bus of this trace is not configured any more");
	else
		*bus = db_words_text(tracing->bus, "name");
	return tracing->bus ? found : 0;
}

/* The bus of the command line, or the only one. */
static void choose_bus(struct tracing *tracing, const char **name)
{
	const json_t *buses = json_object_get(tracing->ctl->description, "buses");

	if (*name) {
		tracing->bus = db_ctl_find(tracing->ctl, buses, *name,
		                           DB_CLIENT_SERVICE "NoSuchBus", "no bus is called");
		tracing->status = tracing->bus ? DB_CTL_OK : DB_CTL_USAGE;
	} else if (json_array_size(buses) == 1) {
		tracing->bus = json_array_get(buses, 0);
		*name = db_words_text(tracing->bus, "name");
	} else {
		tracing->status = db_ctl_complain(
			tracing->ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			"there are %zu buses: say which one; drivebridgectl bus lists them",
			json_array_size(buses));
	}
}

static void open_output(struct tracing *tracing)
{
	const char *path = tracing->ctl->output;
	bool can = json_is_true(json_object_get(tracing->bus, "can"));
	bool named = path && strlen(path) > strlen(PCAPNG) &&
	             strcmp(path + strlen(path) - strlen(PCAPNG), PCAPNG) == 0;

	tracing->out = stdout;
	if (!path)
		return;
	tracing->out = fopen(path, "we");
	/* The text of a serial line can be replayed, so it is what is written otherwise. */
	tracing->pcapng = (can || named) && !tracing->ctl->json;
	if (!can)
		tracing->frames.family = db_words_text(tracing->bus, "protocol");
	if (!tracing->out ||
	    (tracing->pcapng && !db_capture_pcapng_begin(tracing->out, tracing->bus)))
		tracing->status = db_ctl_complain(tracing->ctl, DB_CTL_NO,
		                                  "io.drivebridge.Client.File",
		                                  "cannot write %s: %s", path, strerror(errno));
}

static void close_output(struct tracing *tracing)
{
	bool failed;

	if (!tracing->out || tracing->out == stdout)
		return;
	failed = ferror(tracing->out) != 0;
	failed = fclose(tracing->out) != 0 || failed;
	if (tracing->status != DB_CTL_OK)
		return;
	if (failed) {
		tracing->status = db_ctl_complain(
			tracing->ctl, DB_CTL_NO, "io.drivebridge.Client.File",
			"cannot write all of %s: %s", tracing->ctl->output, strerror(errno));
		return;
	}
	if (!tracing->ctl->json)
		db_ctl_say_line(stderr, "%lld records in %s, %lld missing",
		                (long long)tracing->records, tracing->ctl->output,
		                (long long)tracing->missed);
}

/* Until it ends, the time is over or the user ends it. */
static void follow(struct tracing *tracing, double duration)
{
	db_time end = db_client_now() + (db_time)(duration * (double)DB_NS_PER_S);
	int signals = db_ctl_signals_open();
	int turn = 1;

	/* A pipe without a reader ends the command too. */
	while (!tracing->ended && turn >= 0 && !ferror(tracing->out)) {
		db_time left = end - db_client_now();

		if (duration > 0 && left <= 0)
			break;
		turn = db_ctl_follow(tracing->ctl, signals,
		                     duration > 0 ? (int)(left / DB_NS_PER_MS) + 1 : -1);
	}
	if (signals >= 0)
		(void)close(signals);
}

enum db_ctl_status db_ctl_trace(struct db_ctl *ctl, int count, char **arguments)
{
	struct tracing *tracing = calloc(1, sizeof(*tracing));
	const char *name = count > 0 ? arguments[0] : NULL;
	enum db_ctl_status status;
	double duration = 0.0;
	json_int_t kept = 0;
	json_t *parameters;

	if (!tracing)
		return db_ctl_complain(ctl, DB_CTL_NO, DB_CLIENT_NO_MEMORY, "no memory");
	tracing->ctl = ctl;
	if (ctl->duration && !db_words_parse_seconds(ctl->duration, &duration))
		tracing->status = db_ctl_complain(
			ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			"--duration %s: right is a number of seconds, such as 2.5", ctl->duration);
	else if (ctl->kept)
		kept = choose_kept(tracing, &name);
	else
		choose_bus(tracing, &name);
	if (tracing->status == DB_CTL_OK)
		open_output(tracing);
	if (tracing->status == DB_CTL_OK) {
		parameters = json_pack("{s:s, s:b}", "bus", name, "past", ctl->past);
		if (kept > 0)
			(void)json_object_set_new(parameters, "kept", json_integer(kept));
		if (db_client_send(ctl->client, "Trace", parameters, true, take_records, tracing) ==
		    0)
			follow(tracing, duration);
		/* Late answers would go to memory that is no longer valid. */
		db_client_close(ctl->client);
		ctl->client = NULL;
	}
	close_output(tracing);
	status = tracing->status;
	free(tracing);
	return status;
}

static void print_kept(const struct db_ctl *ctl, const json_t *kept)
{
	static const char *const heads[] = { DB_CTL_TEXT("NUMBER"), DB_CTL_TEXT("WHEN"),
		                             DB_CTL_TEXT("BUS"), DB_CTL_TEXT("DRIVE"),
		                             DB_CTL_TEXT("EVENT") };
	struct db_ctl_grid *grid = db_ctl_grid_new("rllll");
	char when[DB_WORDS_TIME_MAX];
	char room[DB_WORDS_TEXT_MAX];
	size_t i;
	const json_t *one;

	if (!grid)
		return;
	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
	json_array_foreach(kept, i, one)
	{
		db_words_write_time(json_integer_value(json_object_get(one, "time_us")), when);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld",
		                (long long)json_integer_value(json_object_get(one, "number")));
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", when);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(one, "bus"));
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(one, "drive"));
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s",
		                db_ctl_translate(db_words_text(one, "event"), room));
	}
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

enum db_ctl_status db_ctl_traces(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	json_t *kept = read_kept(ctl, &status);

	(void)count;
	(void)arguments;
	if (kept && ctl->json)
		db_ctl_print_json(kept);
	else if (kept && json_array_size(kept) == 0)
		db_ctl_say_line(
			stdout,
			"no trace was kept: no drive was lost or at fault since the service began");
	else if (kept)
		print_kept(ctl, kept);
	json_decref(kept);
	return status;
}
