/* SPDX-License-Identifier: Apache-2.0 */
#include "client/clock.h"
#include "ctl/ctl_private.h"
#include "ctl/rows.h"
#include "ctl/say.h"
#include "words/value.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define COLUMNS_MAX 64
#define BEFORE_DEFAULT_S 1.0
/* Data may arrive this much later than their time. */
#define GRACE (500 * DB_NS_PER_MS)

struct column {
	char drive[64];
	const char *name; /* after the dot of the argument */
	const json_t *reg;
};

struct recording {
	struct db_ctl *ctl;
	struct column columns[COLUMNS_MAX];
	size_t column_count;
	json_t *registers; /* by drive */
	struct db_capture_trigger trigger;
	struct db_ctl_rows rows;
	FILE *file;
	char scratch[32]; /* path of a file that only the picture needs; "": none */
	json_int_t lost;
	int error; /* errno of the first write that failed; 0: none has */
	bool ended;
	enum db_ctl_status status;
};

static enum db_ctl_status usage(const struct db_ctl *ctl, const char *option, const char *given,
                                const char *right)
{
	return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
	                       "%s %s: right is %s", option, given, right);
}

/* --- what is recorded ------------------------------------------------------------------------- */

/* The register of a drive; a drive's registers are read once. NULL: the reason is printed. */
static const json_t *find_register(struct recording *recording, const char *drive, const char *name)
{
	struct db_ctl *ctl = recording->ctl;
	json_t *registers;
	char unknown[96];

	if (!db_ctl_find_drive(ctl, drive)) {
		recording->status = DB_CTL_USAGE;
		return NULL;
	}
	registers = json_object_get(recording->registers, drive);
	if (!registers) {
		registers = db_ctl_read_registers(ctl, drive, &recording->status);
		if (!registers)
			return NULL;
		(void)json_object_set_new(recording->registers, drive, registers);
	}
	snprintf(unknown, sizeof(unknown), "%s has no register", drive);
	if (!db_ctl_find(ctl, registers, name, DB_CLIENT_SERVICE "NoSuchRegister", unknown))
		recording->status = DB_CTL_USAGE;
	return db_words_look_up(registers, name);
}

/* "feeder.position" */
static void add_column(struct recording *recording, const char *argument)
{
	struct column *column = &recording->columns[recording->column_count];
	const char *dot = strchr(argument, '.');

	if (!dot || (size_t)(dot - argument) >= sizeof(column->drive) ||
	    recording->column_count == COLUMNS_MAX) {
		recording->status = usage(recording->ctl, "record", argument,
		                          dot ? DB_CTL_TEXT("not more than 64 values") :
		                                DB_CTL_TEXT("DRIVE.NAME, such as feeder.position"));
		return;
	}
	snprintf(column->drive, sizeof(column->drive), "%.*s", (int)(dot - argument), argument);
	column->name = dot + 1;
	column->reg = find_register(recording, column->drive, column->name);
	recording->column_count++;
}

static void read_trigger(struct recording *recording, const char *text)
{
	struct db_capture_trigger *trigger = &recording->trigger;
	const char *value = NULL;
	const char *wrong = db_capture_trigger_split(text, trigger, &value);
	const json_t *reg;
	char problem[256];

	if (wrong) {
		recording->status = db_ctl_complain(recording->ctl, DB_CTL_USAGE,
		                                    "io.drivebridge.Client.Usage",
		                                    "--trigger %s: %s", text, wrong);
		return;
	}
	reg = find_register(recording, trigger->drive, trigger->name);
	if (!reg)
		return;
	if (!db_capture_trigger_set(trigger, reg, value, problem, sizeof(problem)))
		recording->status = db_ctl_complain(recording->ctl, DB_CTL_USAGE,
		                                    "io.drivebridge.Client.Usage",
		                                    "--trigger %s: %s", text, problem);
	recording->rows.trigger = trigger;
	recording->rows.trigger_drive = trigger->drive;
}

/* Reads an option in seconds, if it is given. */
static void read_seconds(struct recording *recording, const char *option, const char *text,
                         json_int_t *us)
{
	double seconds;

	if (!text)
		return;
	if (db_words_parse_seconds(text, &seconds))
		*us = (json_int_t)(seconds * 1e6);
	else
		recording->status = usage(recording->ctl, option, text,
		                          DB_CTL_TEXT("a number of seconds, such as 2.5"));
}

static void read_arguments(struct recording *recording, int count, char **arguments)
{
	const struct db_ctl *ctl = recording->ctl;
	struct db_ctl_rows *rows = &recording->rows;
	char *end = NULL;

	rows->before_us = (json_int_t)(BEFORE_DEFAULT_S * 1e6);
	read_seconds(recording, "--before", ctl->before, &rows->before_us);
	read_seconds(recording, "--duration", ctl->duration, &rows->duration_us);
	if (ctl->samples) {
		rows->samples_max = strtoll(ctl->samples, &end, 10);
		if (*end != '\0' || rows->samples_max <= 0)
			recording->status = usage(ctl, "--samples", ctl->samples,
			                          DB_CTL_TEXT("a number above 0"));
	}
	if (ctl->plot && !db_ctl_plot_is_picture(ctl->plot))
		recording->status = usage(
			ctl, "--plot", ctl->plot,
			DB_CTL_TEXT("terminal, or a file whose name ends with .svg"));
	if (ctl->before && !ctl->trigger)
		recording->status = usage(ctl, "--before", ctl->before,
		                          DB_CTL_TEXT("only with a trigger"));
	for (int i = 0; recording->status == DB_CTL_OK && i < count; i++)
		add_column(recording, arguments[i]);
	if (recording->status == DB_CTL_OK && ctl->trigger)
		read_trigger(recording, ctl->trigger);
}

/* --- the file --------------------------------------------------------------------------------- */

static void open_file(struct recording *recording)
{
	const char *path = recording->ctl->output;
	int scratch = -1;

	recording->file = stdout;
	if (path) {
		recording->file = fopen(path, "we");
	} else if (recording->ctl->plot) {
		strcpy(recording->scratch, "/tmp/drivebridgectl-XXXXXX");
		scratch = mkstemp(recording->scratch);
		recording->file = scratch >= 0 ? fdopen(scratch, "w") : NULL;
	}
	if (!recording->file)
		recording->status = db_ctl_complain(
			recording->ctl, DB_CTL_NO, "io.drivebridge.Client.File",
			"cannot write %s: %s", path ? path : recording->scratch, strerror(errno));
}

static void write_sample(void *context, const json_t *sample, json_int_t time_us)
{
	struct recording *recording = context;
	json_int_t wall_us = json_integer_value(json_object_get(sample, "time_us"));
	const json_t *values = json_object_get(sample, "values");
	const char *drive = db_words_text(sample, "drive");

	recording->lost += json_integer_value(json_object_get(sample, "lost"));
	fprintf(recording->file, "%s%lld.%06lld,%lld.%06lld", time_us < 0 ? "-" : "",
	        llabs(time_us) / 1000000, llabs(time_us) % 1000000, (long long)(wall_us / 1000000),
	        (long long)(wall_us % 1000000));
	for (size_t i = 0; i < recording->column_count; i++) {
		const struct column *column = &recording->columns[i];

		db_ctl_csv_add_value(recording->file, false,
		                     strcmp(drive, column->drive) == 0 ?
		                             json_object_get(values, column->name) :
		                             NULL);
	}
	db_ctl_csv_end_line(recording->file);
}

/* Flushed, so that another reader of the file sees all samples. */
static void write_out(struct recording *recording)
{
	if (fflush(recording->file) != 0 && recording->error == 0)
		recording->error = errno;
}

/* Prints the result for people; and draws the picture. */
static void finish(struct recording *recording)
{
	const struct db_ctl *ctl = recording->ctl;
	const char *path = recording->scratch[0] ? recording->scratch : ctl->output;

	write_out(recording);
	if (recording->file != stdout && fclose(recording->file) != 0 && recording->error == 0)
		recording->error = errno;
	if (recording->error != 0 && recording->status == DB_CTL_OK)
		recording->status = db_ctl_complain(
			ctl, DB_CTL_NO, "io.drivebridge.Client.File", "cannot write all of %s: %s",
			path ? path : DB_CTL_TEXT("the record"), strerror(recording->error));
	if (recording->status == DB_CTL_OK && ctl->trigger && !recording->rows.begun)
		recording->status = db_ctl_complain(ctl, DB_CTL_NO,
		                                    "io.drivebridge.Client.NoTrigger",
		                                    "%s did not come", ctl->trigger);
	if (ctl->output)
		db_ctl_say_line(stderr, "%lld samples in %s, %lld lost",
		                (long long)recording->rows.written, ctl->output,
		                (long long)recording->lost);
	else
		db_ctl_say_line(stderr, "%lld samples, %lld lost",
		                (long long)recording->rows.written, (long long)recording->lost);
	if (ctl->plot && recording->rows.written > 0 && recording->status == DB_CTL_OK)
		recording->status = db_ctl_plot(ctl, path, recording->column_count + 2, ctl->plot);
	if (recording->scratch[0])
		(void)unlink(recording->scratch);
}

/* --- the stream ------------------------------------------------------------------------------- */

static void take_samples(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct recording *recording = data;
	bool waited = recording->rows.trigger_drive && !recording->rows.begun;
	size_t i;
	json_t *sample;

	recording->ended = recording->ended || !more;
	if (error) {
		recording->status = db_ctl_fail(recording->ctl, error);
		return;
	}
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
	{
		if (!db_ctl_rows_take(&recording->rows, sample)) {
			recording->status = db_ctl_complain(recording->ctl, DB_CTL_NO,
			                                    DB_CLIENT_NO_MEMORY, "no memory");
			recording->ended = true;
		}
	}
	write_out(recording);
	if (waited && recording->rows.begun)
		db_ctl_say_line(stderr, "%s came", recording->ctl->trigger);
	recording->ended = recording->ended || recording->rows.ended;
}

static int subscribe(struct recording *recording)
{
	json_t *drives = json_array();
	json_t *names = json_array();
	const char *drive;
	json_t *unused;

	json_object_foreach(recording->registers, drive, unused)
	{
		(void)unused;
		(void)json_array_append_new(drives, json_string(drive));
	}
	for (size_t i = 0; i < recording->column_count; i++)
		(void)json_array_append_new(names, json_string(recording->columns[i].name));
	if (recording->rows.trigger_drive)
		(void)json_array_append_new(names, json_string(recording->trigger.name));
	return db_client_send(
		recording->ctl->client, "Subscribe",
		json_pack("{s:o, s:o, s:i}", "drives", drives, "names", names, "interval_ms", 0),
		true, take_samples, recording);
}

/* Until the record is complete, or the user ends it. */
static void follow(struct recording *recording)
{
	const struct db_ctl_rows *rows = &recording->rows;
	int signals = db_ctl_signals_open();
	db_time end = DB_TIME_NEVER;
	int turn = 1;

	/* A pipe without a reader ends the command too. */
	while (!recording->ended && recording->error == 0 && turn >= 0) {
		/* A silent drive sends no more sample times: end by the clock. */
		if (end == DB_TIME_NEVER && rows->begun && rows->duration_us > 0)
			end = db_client_now() + rows->duration_us * DB_NS_PER_US + GRACE;
		if (db_client_now() >= end)
			break;
		turn = db_ctl_follow(recording->ctl, signals, end != DB_TIME_NEVER ? 100 : -1);
	}
	if (signals >= 0)
		(void)close(signals);
}

enum db_ctl_status db_ctl_record(struct db_ctl *ctl, int count, char **arguments)
{
	struct recording recording = { .ctl = ctl, .registers = json_object() };
	char text[256];

	recording.rows.write = write_sample;
	recording.rows.context = &recording;
	read_arguments(&recording, count, arguments);
	if (recording.status == DB_CTL_OK)
		open_file(&recording);
	if (recording.status == DB_CTL_OK) {
		db_ctl_csv_add_text(recording.file, true, "time_s");
		db_ctl_csv_add_text(recording.file, false, "unix_time_s");
		for (size_t i = 0; i < recording.column_count; i++) {
			const struct column *column = &recording.columns[i];
			const char *unit = db_words_text(column->reg, "unit");

			snprintf(text, sizeof(text), "%s.%s%s%s%s", column->drive, column->name,
			         unit[0] ? " [" : "", unit, unit[0] ? "]" : "");
			db_ctl_csv_add_text(recording.file, false, text);
		}
		db_ctl_csv_end_line(recording.file);
		(void)fflush(recording.file);
		if (subscribe(&recording) == 0)
			follow(&recording);
		finish(&recording);
	}
	/* Late answers would go to memory that is no longer valid. */
	db_client_close(ctl->client);
	ctl->client = NULL;
	db_ctl_rows_clear(&recording.rows);
	json_decref(recording.registers);
	return recording.status;
}
