/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes parameters from a file into a drive: one after the other, each read back, and only those
 * that differ. Started again after an interruption, it continues with what still differs.
 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "params/writer.h"
#include "words/value.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

struct restore {
	struct db_ctl *ctl;
	struct db_params drive; /* its parameters before the restore */
	struct db_params file;
	struct db_params_changes changes;
	json_t *plan;
	json_t *kept; /* names of settings that the drive has as the file */
	struct db_params_writer writer;
};

/* --- before ----------------------------------------------------------------------------------- */

static enum db_ctl_status check_drive(const struct restore *restore)
{
	const struct db_params *file = &restore->file;
	const struct db_params *drive = &restore->drive;
	enum db_ctl_status status = db_ctl_params_check_families(restore->ctl, file, drive);

	if (status != DB_CTL_OK)
		return status;
	if (strcmp(file->identity, drive->identity) != 0 && !restore->ctl->json)
		db_ctl_say_line(
			stderr,
			"another model or firmware: the file is of \"%s\", and %s is \"%s\"",
			file->identity, drive->name, drive->identity);
	/* They change a running motion, and some drives accept or report them only at
	 * standstill. */
	if (db_words_has_bit(db_words_look_up(drive->registers, "status"),
	                     json_object_get(drive->values, "status"), "moving"))
		return db_ctl_complain(restore->ctl, DB_CTL_NO, "io.drivebridge.Client.Moving",
		                       "%s moves; stop it first: drivebridgectl run %s stop",
		                       drive->name, drive->name);
	return DB_CTL_OK;
}

static void add_row(struct db_ctl_grid *grid, const struct restore *restore, const char *name)
{
	const json_t *reg = db_words_look_up(restore->drive.registers, name);
	char text[DB_WORDS_VALUE_MAX];

	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", name);
	db_words_write_bare_value(reg, db_params_value(&restore->drive, name), text, sizeof(text));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", text);
	db_words_write_bare_value(reg, db_params_value(&restore->file, name), text, sizeof(text));
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", text);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(reg, "unit"));
}

static void show_plan(const struct restore *restore)
{
	struct db_ctl_grid *grid = restore->ctl->json ? NULL : db_ctl_grid_new("lrrl");
	size_t i;
	size_t at;
	const json_t *names;
	const json_t *name;

	if (!grid)
		return;
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_ctl_say("NAME"));
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", restore->drive.name);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", restore->file.name);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_ctl_say("UNIT"));
	json_array_foreach(restore->plan, i, names)
	{
		json_array_foreach(names, at, name)
		{
			add_row(grid, restore, json_string_value(name));
		}
	}
	if (json_array_size(restore->plan) > 0)
		db_ctl_grid_print(grid, restore->ctl->colour, 0, "\n", stdout);
	else
		db_ctl_say_line(stdout, "%s has what is in %s", restore->drive.name,
		                restore->file.name);
	db_ctl_grid_free(grid);
	json_array_foreach(restore->ctl->with_address ? NULL : restore->changes.addresses, i, name)
	{
		db_ctl_say_line(stdout,
		                "%s is the drive's address or bit rate and stays as it is; "
		                "--with-address writes it",
		                json_string_value(name));
	}
	json_array_foreach(restore->changes.states, i, name)
	{
		db_ctl_say_line(stdout,
		                "%s stays as it is: it is what the drive does now, and no setting",
		                json_string_value(name));
	}
	(void)fflush(stdout);
}

/* --- writing ---------------------------------------------------------------------------------- */

/* "spd = 6400 pulses/s: ok". */
static void report(const struct restore *restore, const char *name, const char *result,
                   const char *reason)
{
	const json_t *reg = db_words_look_up(restore->drive.registers, name);
	const json_t *value = db_params_value(&restore->file, name);
	char text[DB_WORDS_VALUE_MAX];
	char room[DB_WORDS_TEXT_MAX];
	json_t *object;

	if (restore->ctl->json) {
		object = json_pack("{s:s, s:O, s:s, s:s}", "name", name, "value", value, "result",
		                   result, "reason", reason);
		db_ctl_print_json(object);
		json_decref(object);
		return;
	}
	db_words_write_value(reg, value, text, sizeof(text));
	printf("%s = %s: %s%s%s\n", name, text, db_ctl_say_name(result), reason[0] ? ": " : "",
	       db_ctl_translate(reason, room));
	(void)fflush(stdout);
}

/* Those that failed are reported at the end: they may succeed when they are tried again. */
static void report_done(void *data, const char *name, const char *state, const char *text,
                        const json_t *value)
{
	(void)value;
	if (strcmp(state, "done") == 0)
		report(data, name, text, "");
}

static void write_plan(struct restore *restore)
{
	struct db_params_writer *writer = &restore->writer;
	int signals = db_ctl_signals_open();
	const char *wish = NULL; /* to end it */
	const char *method;
	json_t *parameters;

	for (;;) {
		struct db_client_error error = { .parameters = NULL };
		json_t *answer = NULL;
		int interrupted = db_ctl_signals_read(signals);

		if (interrupted != 0 && interrupted != SIGWINCH)
			wish = "interrupted";
		if (wish && !writer->reads_back)
			db_params_writer_end(writer, wish);
		method = db_params_writer_next(writer, &parameters);
		if (!method)
			break;
		(void)db_client_call(restore->ctl->client, method, parameters,
		                     DB_CTL_DRIVE_TIMEOUT_MS, &answer, &error);
		db_params_writer_take(writer, answer, &error);
		db_client_error_clear(&error);
		json_decref(answer);
	}
	if (signals >= 0)
		(void)close(signals);
}

/* --- afterwards ------------------------------------------------------------------------------- */

bool db_ctl_params_can_save(struct db_ctl *ctl, const char *drive)
{
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", drive),
	                             DB_CTL_TIMEOUT_MS, &status);
	bool found = db_words_look_up(json_object_get(answer, "commands"), "save_parameters");

	json_decref(answer);
	return found;
}

static enum db_ctl_status save(const struct restore *restore)
{
	struct db_ctl *ctl = restore->ctl;
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Run",
	                             json_pack("{s:s, s:s, s:b}", "drive", restore->drive.name,
	                                       "command", "save_parameters", "until_end", 1),
	                             DB_CTL_DRIVE_TIMEOUT_MS, &status);

	if (answer && !ctl->json)
		printf("%s: save_parameters: %s\n", restore->drive.name,
		       db_ctl_say_name(db_words_text(answer, "result")));
	json_decref(answer);
	return status;
}

/* "not tried any more: acc dec". */
static void print_untried(const json_t *untried)
{
	size_t i;
	const json_t *name;

	if (json_array_size(untried) == 0)
		return;
	printf("%s:", db_ctl_say("not tried any more"));
	json_array_foreach(untried, i, name)
	{
		printf(" %s", json_string_value(name));
	}
	putchar('\n');
}

static void print_end(const struct restore *restore, const json_t *untried)
{
	const struct db_params_writer *writer = &restore->writer;
	size_t written = json_array_size(writer->written);
	size_t left = json_object_size(writer->failed) + json_array_size(untried);
	bool over = writer->over[0] != '\0';
	const char *name;
	const json_t *reason;

	json_object_foreach(writer->failed, name, reason)
	{
		const char *why = json_string_value(reason);

		report(restore, name,
		       strcmp(why, writer->over) == 0 ? DB_CTL_TEXT("stopped") :
		                                        DB_CTL_TEXT("failed"),
		       why);
	}
	if (restore->ctl->json)
		return;
	print_untried(untried);
	if (left == 0 && over)
		db_ctl_say_line(stdout,
		                "%s: %zu written; whether something has changed them since is not "
		                "known: %s",
		                restore->drive.name, written, writer->over);
	else if (left == 0)
		db_ctl_say_line(stdout, "%s: %zu written", restore->drive.name, written);
	else
		db_ctl_say_line(stdout,
		                over && !writer->for_good ?
		                        DB_CTL_TEXT("%s: %zu written, %zu not; the same command "
		                                    "goes on with them") :
		                        DB_CTL_TEXT("%s: %zu written, %zu not"),
		                restore->drive.name, written, left);
	(void)fflush(stdout);
}

static void print_object(const struct restore *restore, const json_t *untried, bool saved)
{
	const struct db_params_writer *writer = &restore->writer;
	bool same = strcmp(restore->file.identity, restore->drive.identity) == 0;
	json_t *object = json_pack("{s:s, s:s, s:b, s:O, s:O, s:O, s:b, s:b}", "drive",
	                           restore->drive.name, "file", restore->file.name, "same_model",
	                           same, "written", writer->written, "failed", writer->failed,
	                           "not_tried", untried, "ended", writer->over[0] == '\0', "saved",
	                           saved);

	db_ctl_print_json(object);
	json_decref(object);
}

/* Writes, and reports the result. */
static enum db_ctl_status carry_out(struct restore *restore)
{
	struct db_ctl *ctl = restore->ctl;
	struct db_params_writer *writer = &restore->writer;
	enum db_ctl_status status = DB_CTL_OK;
	bool saved = false;
	json_t *untried;

	write_plan(restore);
	untried = db_params_writer_untried(writer);
	print_end(restore, untried);
	if (writer->over[0] != '\0') {
		status = writer->lost ? DB_CTL_UNREACHABLE : DB_CTL_NO;
	} else if (db_ctl_params_can_save(ctl, restore->drive.name)) {
		if (ctl->save && writer->changed) {
			status = db_ctl_complain(
				ctl, DB_CTL_NO, "io.drivebridge.Client.Changed",
				"not saved: something else has changed parameters of %s meanwhile",
				restore->drive.name);
		} else if (ctl->save) {
			status = save(restore);
			saved = status == DB_CTL_OK;
		} else if (!ctl->json && json_array_size(writer->written) > 0) {
			db_ctl_say_line(stdout,
			                "not saved in the drive yet: drivebridgectl run %s "
			                "save_parameters",
			                restore->drive.name);
		}
	} else if (ctl->save) {
		status = db_ctl_complain(
			ctl, DB_CTL_NO, DB_CLIENT_SERVICE "NoSuchCommand",
			"%s has no save_parameters: what is written is all there is",
			restore->drive.name);
	}
	if (ctl->json)
		print_object(restore, untried, saved);
	json_decref(untried);
	return status == DB_CTL_OK && json_object_size(writer->failed) > 0 ? DB_CTL_NO : status;
}

static json_t *list_kept(const struct restore *restore)
{
	json_t *kept = json_array();
	const char *name;
	const json_t *value;

	json_object_foreach(restore->file.values, name, value)
	{
		const json_t *reg = db_words_look_up(restore->drive.registers, name);

		if (!db_params_has_trait(reg, "state") && !db_params_has_trait(reg, "address") &&
		    db_params_agree(value, db_params_value(&restore->drive, name)))
			(void)json_array_append_new(kept, json_string(name));
	}
	return kept;
}

/* Both sets have been read. */
static enum db_ctl_status restore_params(struct restore *restore)
{
	struct db_ctl *ctl = restore->ctl;
	enum db_ctl_status status = check_drive(restore);
	json_t *names;

	if (status != DB_CTL_OK)
		return status;
	db_params_find_changes(&restore->drive, &restore->file, &restore->changes);
	names = json_copy(restore->changes.settings);
	if (ctl->with_address)
		(void)json_array_extend(names, restore->changes.addresses);
	restore->plan = db_params_order(restore->drive.registers, names);
	json_decref(names);
	restore->kept = list_kept(restore);
	show_plan(restore);
	if (json_array_size(restore->plan) > 0)
		status = db_ctl_ask(ctl, "write %zu into %s?", db_params_plan_size(restore->plan),
		                    restore->drive.name);
	if (status != DB_CTL_OK)
		return status;
	restore->writer = (struct db_params_writer){
		.drive = restore->drive.name,
		.registers = restore->drive.registers,
		.values = restore->file.values,
		.plan = restore->plan,
		.kept = restore->kept,
		.standing = true,
		.report = report_done,
		.data = restore,
	};
	db_params_writer_begin(&restore->writer);
	return carry_out(restore);
}

enum db_ctl_status db_ctl_params_restore(struct db_ctl *ctl, int count, char **arguments)
{
	struct restore restore = { .ctl = ctl };
	enum db_ctl_status status;
	json_t *families = db_ctl_read_families(ctl, &status);

	(void)count;
	if (status == DB_CTL_OK)
		status = db_ctl_params_read_drive(ctl, families, arguments[0], true,
		                                  &restore.drive);
	if (status == DB_CTL_OK)
		status = db_ctl_params_read_file(ctl, families, arguments[1], &restore.file);
	if (status == DB_CTL_OK)
		status = restore_params(&restore);
	db_params_clear(&restore.drive);
	db_params_clear(&restore.file);
	db_params_clear_changes(&restore.changes);
	db_params_writer_clear(&restore.writer);
	json_decref(restore.plan);
	json_decref(restore.kept);
	json_decref(families);
	return status;
}
