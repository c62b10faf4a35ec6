/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/trace.h"
#include "client/clock.h"
#include "ctl/grid.h"
#include "ctl/pcapng.h"
#include "ctl/signals.h"
#include "ctl/trace_text.h"
#include "ctl/value.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define COMMENT_MAX 2048

struct tracing {
	struct db_ctl *ctl;
	const json_t *bus;
	FILE *out;
	bool pcapng;
	bool headed;
	json_int_t records;
	json_int_t missed;
	json_int_t missed_before; /* the next frame of a file */
	/* What happened between two frames of a file: goes into the comment of the next. */
	char comment[COMMENT_MAX];
	struct db_ctl_questions questions;
	char line[DB_CTL_TRACE_LINE];
	bool ended;
	enum db_ctl_status status;
};

/* --- where records go --------------------------------------------------------------------------------- */

static void write_text(struct tracing *tracing, const json_t *record)
{
	bool coloured = tracing->ctl->colour && tracing->out == stdout;
	enum db_ctl_colour colour = db_ctl_trace_colour(record);

	if (!tracing->headed) {
		db_ctl_trace_write_head(tracing->bus,
		                        json_integer_value(json_object_get(record, "time_us")),
		                        tracing->line, sizeof(tracing->line));
		(void)fputs(tracing->line, tracing->out);
		tracing->headed = true;
	}
	db_ctl_trace_write_line(&tracing->questions, record, tracing->line, sizeof(tracing->line));
	(void)fprintf(tracing->out, "%s%s%s\n", db_ctl_colour_begin(coloured, colour),
	              tracing->line, db_ctl_colour_end(coloured, colour));
}

/* False: that is no frame. */
static bool read_frame(const json_t *record, struct db_ctl_pcapng_frame *frame)
{
	const char *data = db_ctl_text(record, "data");

	if (!json_is_integer(json_object_get(record, "id")))
		return false;
	frame->time_us = json_integer_value(json_object_get(record, "time_us"));
	frame->sent = strcmp(db_ctl_text(record, "direction"), "sent") == 0;
	frame->id = (uint32_t)json_integer_value(json_object_get(record, "id"));
	for (; data[0] && data[1] && frame->length < sizeof(frame->data); data += 2) {
		const char digits[] = { data[0], data[1], '\0' };

		frame->data[frame->length++] = (uint8_t)strtoul(digits, NULL, 16);
	}
	return true;
}

static void write_pcapng(struct tracing *tracing, const json_t *record)
{
	struct db_ctl_pcapng_frame frame = { .comment = tracing->comment };
	size_t used = strlen(tracing->comment);
	char words[DB_CTL_TRACE_LINE];

	db_ctl_trace_write_words(&tracing->questions, record, words, sizeof(words));
	/* Remembers the question. */
	db_ctl_trace_write_line(&tracing->questions, record, tracing->line, sizeof(tracing->line));
	(void)snprintf(tracing->comment + used, sizeof(tracing->comment) - used, "%s%s: %s",
	               used > 0 ? "; " : "", db_ctl_text(record, "kind"), words);
	if (!read_frame(record, &frame))
		return;
	frame.missed = (uint64_t)tracing->missed_before;
	(void)db_ctl_pcapng_add(tracing->out, &frame);
	tracing->missed_before = 0;
	tracing->comment[0] = '\0';
}

static void write_json(const struct tracing *tracing, const json_t *record)
{
	(void)json_dumpf(record, tracing->out, JSON_COMPACT);
	(void)fputc('\n', tracing->out);
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
	tracing->missed_before += missed;
	if (missed > 0 && !tracing->pcapng && !tracing->ctl->json)
		(void)fprintf(tracing->out, "# %lld records are missing here\n", (long long)missed);
	json_array_foreach(json_object_get(parameters, "records"), i, record)
	{
		tracing->records++;
		if (tracing->pcapng)
			write_pcapng(tracing, record);
		else if (tracing->ctl->json)
			write_json(tracing, record);
		else
			write_text(tracing, record);
	}
	(void)fflush(tracing->out);
}

/* --- which trace -------------------------------------------------------------------------------------- */

/* The kept traces as an array that the caller frees; NULL: the reason is printed. */
static json_t *read_kept(struct db_ctl *ctl, enum db_ctl_status *status)
{
	json_t *answer = db_ctl_call(ctl, "Traces", NULL, DB_CTL_TIMEOUT_MS, status);
	json_t *kept = json_incref(json_object_get(answer, "kept"));

	json_decref(answer);
	return kept;
}

/* The trace that --kept names: its number, and its bus unless one was given. 0: the reason is printed. */
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

		if ((*bus && strcmp(*bus, db_ctl_text(one, "bus")) != 0) ||
		    (!last && (*end != '\0' || number != this_number)))
			continue;
		found = this_number;
		tracing->bus = db_ctl_look_up(json_object_get(ctl->description, "buses"),
		                              db_ctl_text(one, "bus"));
	}
	json_decref(kept);
	if (found == 0)
		tracing->status = db_ctl_complain(
			ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "NoSuchTrace",
			"no trace%s%s was kept%s%s; drivebridgectl traces lists those that were",
			last ? "" : " ", last ? "" : ctl->kept, *bus ? " of bus " : "",
			*bus ? *bus : "");
	else if (!tracing->bus)
		tracing->status = db_ctl_complain(
			ctl, DB_CTL_NO, DB_CLIENT_SERVICE "NoSuchBus",
			"the bus of this trace is not configured any more");
	else
		*bus = db_ctl_text(tracing->bus, "name");
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
		*name = db_ctl_text(tracing->bus, "name");
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
	char description[256];

	tracing->out = stdout;
	if (!path)
		return;
	tracing->out = fopen(path, "we");
	tracing->pcapng = can && !tracing->ctl->json;
	(void)snprintf(description, sizeof(description), "%s at %lld bit/s, bus %s of drivebridge",
	               db_ctl_text(tracing->bus, "device"),
	               (long long)json_integer_value(json_object_get(tracing->bus, "speed")),
	               db_ctl_text(tracing->bus, "name"));
	if (!tracing->out ||
	    (tracing->pcapng &&
	     !db_ctl_pcapng_begin(tracing->out, db_ctl_text(tracing->bus, "name"), description)))
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
		(void)fprintf(stderr, "%lld records in %s, %lld missing\n",
		              (long long)tracing->records, tracing->ctl->output,
		              (long long)tracing->missed);
}

/* Until it ends, the time is over or somebody ends it. */
static void follow(struct tracing *tracing, double duration)
{
	struct pollfd fds[2] = { { .fd = db_client_fd(tracing->ctl->client) },
		                 { .fd = db_ctl_signals_open(), .events = POLLIN } };
	db_time end = db_client_now() + (db_time)(duration * (double)DB_NS_PER_S);
	int signal_number;

	while (!tracing->ended) {
		db_time left = end - db_client_now();

		if (duration > 0 && left <= 0)
			break;
		fds[0].events = db_client_poll_events(tracing->ctl->client);
		(void)poll(fds, 2, duration > 0 ? (int)(left / DB_NS_PER_MS) + 1 : -1);
		signal_number = db_ctl_signals_read(fds[1].fd);
		/* A pipe that nobody reads any more ends it as well. */
		if ((signal_number != 0 && signal_number != SIGWINCH && signal_number != SIGTSTP) ||
		    ferror(tracing->out))
			break;
		(void)db_client_handle(tracing->ctl->client);
	}
	if (fds[1].fd >= 0)
		(void)close(fds[1].fd);
}

/* Everything between the choice of the trace and its end. */
static void run_trace(struct tracing *tracing, const char *name, json_int_t kept, double duration)
{
	struct db_ctl *ctl = tracing->ctl;
	json_t *parameters = json_pack("{s:s, s:b}", "bus", name, "past", ctl->past);

	if (kept > 0)
		(void)json_object_set_new(parameters, "kept", json_integer(kept));
	if (db_client_send(ctl->client, "Trace", parameters, true, take_records, tracing) == 0)
		follow(tracing, duration);
	/* Answers that still come have nowhere to go. */
	db_client_close(ctl->client);
	ctl->client = NULL;
}

enum db_ctl_status db_ctl_trace(struct db_ctl *ctl, int count, char **arguments)
{
	struct tracing *tracing = calloc(1, sizeof(*tracing));
	const char *name = count > 0 ? arguments[0] : NULL;
	enum db_ctl_status status;
	double duration = 0.0;
	json_int_t kept = 0;

	if (!tracing)
		return db_ctl_complain(ctl, DB_CTL_NO, DB_CLIENT_NO_MEMORY, "no memory");
	tracing->ctl = ctl;
	if (ctl->duration && !db_ctl_parse_seconds(ctl->duration, &duration))
		tracing->status = db_ctl_complain(
			ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			"--duration %s: right is a number of seconds, such as 2.5", ctl->duration);
	else if (ctl->kept)
		kept = choose_kept(tracing, &name);
	else
		choose_bus(tracing, &name);
	if (tracing->status == DB_CTL_OK)
		open_output(tracing);
	if (tracing->status == DB_CTL_OK)
		run_trace(tracing, name, kept, duration);
	close_output(tracing);
	status = tracing->status;
	free(tracing);
	return status;
}

static void print_kept(const struct db_ctl *ctl, const json_t *kept)
{
	static const char *const heads[] = { "NUMBER", "WHEN", "BUS", "DRIVE", "EVENT" };
	struct db_ctl_grid *grid = db_ctl_grid_new("rllll");
	char when[DB_CTL_TIME_MAX];
	size_t i;
	const json_t *one;

	if (!grid)
		return;
	for (i = 0; i < sizeof(heads) / sizeof(heads[0]); i++)
		db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", heads[i]);
	json_array_foreach(kept, i, one)
	{
		db_ctl_write_time(json_integer_value(json_object_get(one, "time_us")), when);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld",
		                (long long)json_integer_value(json_object_get(one, "number")));
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", when);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_text(one, "bus"));
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_text(one, "drive"));
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_text(one, "event"));
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
		(void)puts(
			"no trace was kept: no drive was lost or at fault since the service began");
	else if (kept)
		print_kept(ctl, kept);
	json_decref(kept);
	return status;
}
