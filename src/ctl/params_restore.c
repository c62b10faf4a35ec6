/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parameters from a file into a drive. One after the other, each read back, and only what differs: started again after
 * whatever ended it, it goes on where it was.
 */
#include "ctl/params_restore.h"
#include "ctl/ask.h"
#include "ctl/grid.h"
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/signals.h"
#include "ctl/value.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

struct restore {
	struct db_ctl *ctl;
	struct db_ctl_params drive; /* as it was before */
	struct db_ctl_params file;
	json_t *plan;    /* see db_ctl_params_plan() */
	json_t *skipped; /* the same of addresses that are not to be written */
	json_t *states;  /* names, see db_ctl_params_states() */
	int signals;     /* a descriptor, see signals.h */
	json_t *written; /* names */
	json_t *failed;  /* reasons by name */
	/* Not DB_CTL_OK: nothing more can be written, for the drive or the service is gone, or who asked has had enough. */
	enum db_ctl_status over;
};

static size_t count_names(const json_t *plan)
{
	size_t count = 0;
	size_t i;
	const json_t *names;

	json_array_foreach(plan, i, names) count += json_array_size(names);
	return count;
}

/* --- before ----------------------------------------------------------------------------------------- */

static enum db_ctl_status check_drive(const struct restore *restore)
{
	const struct db_ctl_params *file = &restore->file;
	const struct db_ctl_params *drive = &restore->drive;
	enum db_ctl_status status = db_ctl_params_check_families(restore->ctl, file, drive);

	if (status != DB_CTL_OK)
		return status;
	if (strcmp(file->identity, drive->identity) != 0 && !restore->ctl->json)
		(void)fprintf(
			stderr,
			"another model or firmware: the file is of \"%s\", and %s is \"%s\"\n",
			file->identity, drive->name, drive->identity);
	/* They change how a motion goes on, and some drives take or tell them only while they stand. */
	if (db_ctl_has_bit(db_ctl_look_up(drive->registers, "status"),
	                   json_object_get(drive->values, "status"), "moving"))
		return db_ctl_complain(restore->ctl, DB_CTL_NO, "io.drivebridge.Client.Moving",
		                       "%s moves; stop it first: drivebridgectl run %s stop",
		                       drive->name, drive->name);
	return DB_CTL_OK;
}

static void add_rows(struct db_ctl_grid *grid, const struct restore *restore, const json_t *plan)
{
	char text[DB_CTL_VALUE_MAX];
	size_t i;
	size_t at;
	const json_t *names;
	const json_t *name;

	json_array_foreach(plan, i, names)
	{
		json_array_foreach(names, at, name)
		{
			const json_t *reg = db_ctl_look_up(restore->drive.registers,
			                                   json_string_value(name));

			db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_text(reg, "name"));
			db_ctl_write_bare_value(
				reg, db_ctl_params_value(&restore->drive, db_ctl_text(reg, "name")),
				text, sizeof(text));
			db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", text);
			db_ctl_write_bare_value(
				reg, db_ctl_params_value(&restore->file, db_ctl_text(reg, "name")),
				text, sizeof(text));
			db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", text);
			db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_text(reg, "unit"));
		}
	}
}

static void show_plan(const struct restore *restore)
{
	struct db_ctl_grid *grid = db_ctl_grid_new("lrrl");
	size_t i;
	const json_t *names;
	const json_t *name;

	if (!grid || restore->ctl->json) {
		db_ctl_grid_free(grid);
		return;
	}
	db_ctl_grid_add(grid, DB_CTL_BOLD, "NAME");
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", restore->drive.name);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", restore->file.name);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "UNIT");
	add_rows(grid, restore, restore->plan);
	if (json_array_size(restore->plan) > 0)
		db_ctl_grid_print(grid, restore->ctl->colour, 0, "\n", stdout);
	else
		(void)printf("%s has what is in %s\n", restore->drive.name, restore->file.name);
	db_ctl_grid_free(grid);
	json_array_foreach(restore->skipped, i, names)(void)
		printf("%s stays as it is: it says where the drive is heard; --with-address "
	               "writes it\n",
	               json_string_value(json_array_get(names, 0)));
	json_array_foreach(restore->states, i, name)(void)
		printf("%s stays as it is: it is what the drive does now, and no setting\n",
	               json_string_value(name));
	(void)fflush(stdout);
}

/* --- writing ---------------------------------------------------------------------------------------- */

/* "spd = 6400 pulses/s: ok". */
static void report(const struct restore *restore, const char *name, const char *result,
                   const char *reason)
{
	const json_t *reg = db_ctl_look_up(restore->drive.registers, name);
	const json_t *value = db_ctl_params_value(&restore->file, name);
	char text[DB_CTL_VALUE_MAX];
	json_t *object;

	if (restore->ctl->json) {
		object = json_pack("{s:s, s:O, s:s, s:s}", "name", name, "value", value, "result",
		                   result, "reason", reason);
		db_ctl_print_json(object);
		json_decref(object);
		return;
	}
	db_ctl_write_value(reg, value, text, sizeof(text));
	(void)printf("%s = %s: %s%s%s\n", name, text, result, reason[0] ? ": " : "", reason);
	(void)fflush(stdout);
}

/* What the drive says it holds now, of those that were written: only what it then has is reported as that. */
static void read_back(struct restore *restore, const json_t *names, const char *result)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_ctl_params held = { .values = NULL };
	json_t *answer = NULL;
	char text[DB_CTL_VALUE_MAX];
	char reason[DB_CTL_VALUE_MAX + 32];
	size_t i;
	json_t *name;

	if (db_client_call(restore->ctl->client, "Read",
	                   json_pack("{s:s, s:O}", "drive", restore->drive.name, "names", names),
	                   DB_CTL_DRIVE_TIMEOUT_MS, &answer, &error) == 0)
		held.values = json_incref(json_object_get(answer, "values"));
	db_client_error_clear(&error);
	json_array_foreach(names, i, name)
	{
		const char *called = json_string_value(name);
		const json_t *value = db_ctl_params_value(&held, called);

		reason[0] = '\0';
		if (!value) {
			(void)snprintf(reason, sizeof(reason), "the drive does not tell it");
		} else if (!db_ctl_params_agree(&held, &restore->file, called)) {
			db_ctl_write_value(db_ctl_look_up(restore->drive.registers, called), value,
			                   text, sizeof(text));
			(void)snprintf(reason, sizeof(reason), "the drive shows %s", text);
		}
		if (reason[0]) {
			(void)json_object_set_new(restore->failed, called, json_string(reason));
			continue;
		}
		report(restore, called, result, "");
		(void)json_array_append(restore->written, name);
		(void)json_object_del(restore->failed, called);
	}
	json_decref(held.values);
	json_decref(answer);
}

/* DB_CTL_OK: others may go where this one did not. */
static enum db_ctl_status judge_error(const struct db_client_error *error)
{
	static const char *const gone[] = { "offline", "bus_down", "timeout", "indeterminate",
		                            "not_in_control" };
	const char *result = db_ctl_text(error->parameters, "result");

	if (strncmp(error->name, DB_CLIENT_SERVICE, strlen(DB_CLIENT_SERVICE)) != 0)
		return DB_CTL_UNREACHABLE;
	if (strcmp(error->name, DB_CLIENT_SERVICE "NotAllowed") == 0)
		return DB_CTL_NO;
	for (size_t i = 0; i < sizeof(gone) / sizeof(gone[0]); i++) {
		if (strcmp(result, gone[i]) == 0)
			return DB_CTL_NO;
	}
	return DB_CTL_OK;
}

static void write_one(struct restore *restore, const json_t *names)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *values = json_object();
	json_t *answer = NULL;
	size_t i;
	const json_t *name;

	json_array_foreach(names, i, name)(void)
		json_object_set(values, json_string_value(name),
	                        json_object_get(restore->file.values, json_string_value(name)));
	if (db_client_call(restore->ctl->client, "Write",
	                   json_pack("{s:s, s:o}", "drive", restore->drive.name, "values", values),
	                   DB_CTL_DRIVE_TIMEOUT_MS, &answer, &error) == 0) {
		read_back(restore, names, db_ctl_text(answer, "result"));
	} else {
		json_array_foreach(names, i, name)(void) json_object_set_new(
			restore->failed, json_string_value(name), json_string(error.text));
		restore->over = judge_error(&error);
	}
	db_client_error_clear(&error);
	json_decref(answer);
}

/*
 * All of the plan, but what came to nothing before is tried only where `again` says so: what a drive refuses because
 * of another parameter it takes when that was written.
 */
static void write_plan(struct restore *restore, bool again)
{
	size_t i;
	const json_t *names;

	json_array_foreach(restore->plan, i, names)
	{
		const char *first = json_string_value(json_array_get(names, 0));
		int interrupted;

		if (again && !json_object_get(restore->failed, first))
			continue;
		interrupted = db_ctl_signals_read(restore->signals);
		if (interrupted != 0 && interrupted != SIGWINCH) {
			restore->over = DB_CTL_NO;
			(void)json_object_set_new(restore->failed, first,
			                          json_string("interrupted"));
		}
		if (restore->over != DB_CTL_OK)
			return;
		write_one(restore, names);
	}
}

/* --- afterwards ------------------------------------------------------------------------------------- */

/* Whether the drive has a memory of its own for them. */
static bool can_save(struct db_ctl *ctl, const char *drive)
{
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", drive),
	                             DB_CTL_TIMEOUT_MS, &status);
	bool found = db_ctl_look_up(json_object_get(answer, "commands"), "save_parameters");

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
		(void)printf("%s: save_parameters: %s\n", restore->drive.name,
		             db_ctl_text(answer, "result"));
	json_decref(answer);
	return status;
}

static void print_end(const struct restore *restore)
{
	size_t left = count_names(restore->plan) - json_array_size(restore->written);
	const char *name;
	const json_t *reason;

	json_object_foreach(restore->failed, name, reason)
		report(restore, name, restore->over != DB_CTL_OK ? "stopped" : "failed",
	               json_string_value(reason));
	if (restore->ctl->json)
		return;
	(void)printf("%s: %zu written", restore->drive.name, json_array_size(restore->written));
	if (left > 0)
		(void)printf(", %zu not%s", left,
		             restore->over != DB_CTL_OK ? "; the same command goes on with them" :
		                                          "");
	(void)putchar('\n');
	(void)fflush(stdout);
}

/* Writes and says how that ended. */
static enum db_ctl_status carry_out(struct restore *restore)
{
	struct db_ctl *ctl = restore->ctl;
	enum db_ctl_status status = DB_CTL_OK;
	json_t *object;
	bool same = strcmp(restore->file.identity, restore->drive.identity) == 0;
	bool saved = false;
	bool all;

	write_plan(restore, false);
	if (restore->over == DB_CTL_OK && json_object_size(restore->failed) > 0 &&
	    json_array_size(restore->written) > 0)
		write_plan(restore, true);
	print_end(restore);
	all = json_array_size(restore->written) == count_names(restore->plan);
	if (restore->over != DB_CTL_OK) {
		status = restore->over;
	} else if (can_save(ctl, restore->drive.name)) {
		if (ctl->save) {
			status = save(restore);
			saved = status == DB_CTL_OK;
		} else if (!ctl->json && json_array_size(restore->written) > 0) {
			(void)printf("not saved in the drive yet: drivebridgectl run %s "
			             "save_parameters\n",
			             restore->drive.name);
		}
	} else if (ctl->save) {
		status = db_ctl_complain(
			ctl, DB_CTL_NO, DB_CLIENT_SERVICE "NoSuchCommand",
			"%s has no save_parameters: what is written is all there is",
			restore->drive.name);
	}
	if (ctl->json) {
		object = json_pack("{s:s, s:s, s:b, s:O, s:O, s:b, s:b}", "drive",
		                   restore->drive.name, "file", restore->file.name, "same_model",
		                   same, "written", restore->written, "failed", restore->failed,
		                   "ended", restore->over == DB_CTL_OK, "saved", saved);
		db_ctl_print_json(object);
		json_decref(object);
	}
	return status == DB_CTL_OK && !all ? DB_CTL_NO : status;
}

/* Both are read. */
static enum db_ctl_status restore_params(struct restore *restore)
{
	struct db_ctl *ctl = restore->ctl;
	enum db_ctl_status status = check_drive(restore);
	json_t *addresses;
	size_t i;
	json_t *names;

	if (status != DB_CTL_OK)
		return status;
	restore->plan = db_ctl_params_plan(&restore->drive, &restore->file, false);
	addresses = db_ctl_params_plan(&restore->drive, &restore->file, true);
	restore->states = db_ctl_params_states(&restore->drive, &restore->file);
	/* At last, for then it may be heard nowhere. */
	json_array_foreach(addresses, i, names)(void)
		json_array_append(ctl->with_address ? restore->plan : restore->skipped, names);
	json_decref(addresses);
	show_plan(restore);
	if (json_array_size(restore->plan) > 0)
		status = db_ctl_ask(restore->ctl, "write %zu into %s?", count_names(restore->plan),
		                    restore->drive.name);
	if (status != DB_CTL_OK)
		return status;
	restore->signals = db_ctl_signals_open();
	status = carry_out(restore);
	if (restore->signals >= 0)
		(void)close(restore->signals);
	return status;
}

enum db_ctl_status db_ctl_params_restore(struct db_ctl *ctl, int count, char **arguments)
{
	struct restore restore = {
		.ctl = ctl,
		.skipped = json_array(),
		.written = json_array(),
		.failed = json_object(),
	};
	enum db_ctl_status status;
	json_t *families = db_ctl_read_families(ctl, &status);

	(void)count;
	if (status == DB_CTL_OK)
		status = db_ctl_params_read_drive(ctl, families, arguments[0], &restore.drive);
	if (status == DB_CTL_OK)
		status = db_ctl_params_read_file(ctl, families, arguments[1], &restore.file);
	if (status == DB_CTL_OK)
		status = restore_params(&restore);
	db_ctl_params_clear(&restore.drive);
	db_ctl_params_clear(&restore.file);
	json_decref(restore.plan);
	json_decref(restore.skipped);
	json_decref(restore.states);
	json_decref(restore.written);
	json_decref(restore.failed);
	json_decref(families);
	return status;
}
