/* SPDX-License-Identifier: Apache-2.0 */
/* Commands that read parameters: list, save, compare. */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "words/value.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* --- list ------------------------------------------------------------------------------------- */

static void add_bare(struct db_ctl_grid *grid, enum db_ctl_colour colour, const json_t *reg,
                     const json_t *value)
{
	char text[DB_WORDS_VALUE_MAX];

	db_words_write_bare_value(reg, value, text, sizeof(text));
	db_ctl_grid_add(grid, colour, "%s", text);
}

static void add_range(struct db_ctl_grid *grid, const json_t *reg)
{
	const json_t *min = json_object_get(reg, "min");
	const json_t *max = json_object_get(reg, "max");

	if (json_is_number(min) && json_is_number(max))
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.9g .. %.9g", json_number_value(min),
		                json_number_value(max));
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
}

/* Time since the drive reported it. */
static void add_age(struct db_ctl_grid *grid, const struct db_params *drive, const char *name)
{
	const json_t *age = json_object_get(drive->ages, name);

	if (json_is_integer(age))
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.1f s",
		                (double)json_integer_value(age) / 1000.0);
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
}

/* Marked are values that differ from the file or, without a file, from the defaults. */
static void print_list(const struct db_ctl *ctl, const struct db_params *drive,
                       const struct db_params *file, const struct db_params *defaults)
{
	static const char *const heads[] = { " ",
		                             DB_CTL_TEXT("NAME"),
		                             DB_CTL_TEXT("VALUE"),
		                             DB_CTL_TEXT("UNIT"),
		                             DB_CTL_TEXT("RANGE"),
		                             DB_CTL_TEXT("AGE"),
		                             DB_CTL_TEXT("DEFAULT"),
		                             DB_CTL_TEXT("FILE") };
	json_t *differ = db_params_compare(drive, file ? file : defaults);
	struct db_ctl_grid *grid = db_ctl_grid_new(file ? "llrllrll" : "llrllrl");
	size_t i;
	const json_t *reg;

	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]) - (file ? 0 : 1));
	json_array_foreach(drive->registers, i, reg)
	{
		const char *name = db_words_text(reg, "name");
		bool changed = db_params_has_name(differ, name);
		const json_t *value = db_params_value(drive, name);

		if (!db_params_is_kept(reg))
			continue;
		db_ctl_grid_add(grid, DB_CTL_YELLOW, changed ? "*" : " ");
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", name);
		add_bare(grid, changed ? DB_CTL_YELLOW : DB_CTL_BOLD, reg, value);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(reg, "unit"));
		add_range(grid, reg);
		add_age(grid, drive, name);
		add_bare(grid, DB_CTL_PLAIN, reg, db_params_value(defaults, name));
		if (file)
			add_bare(grid, DB_CTL_PLAIN, reg, db_params_value(file, name));
	}
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
	if (json_array_size(differ) > 0) {
		putchar('\n');
		db_ctl_say_line(stdout, "* is another in %s",
		                file ? file->name : db_ctl_say("a drive as delivered"));
	}
	json_decref(differ);
}

/* The set as an object: the drive or file, and its values. */
static json_t *describe_set(const struct db_params *params)
{
	json_t *values = json_object();
	size_t i;
	const json_t *reg;

	json_array_foreach(params->registers, i, reg)
	{
		const char *name = db_words_text(reg, "name");

		if (db_params_is_kept(reg))
			(void)json_object_set(values, name, json_object_get(params->values, name));
	}
	return json_pack("{s:s, s:s, s:s, s:o}", "name", params->name, "family", params->family,
	                 "identity", params->identity, "values", values);
}

enum db_ctl_status db_ctl_params_list(struct db_ctl *ctl, int count, char **arguments)
{
	struct db_params drive = { .values = NULL };
	struct db_params file = { .values = NULL };
	struct db_params defaults = { .values = NULL };
	enum db_ctl_status status;
	json_t *families = db_ctl_read_families(ctl, &status);
	json_t *object;

	if (status == DB_CTL_OK)
		status = db_ctl_params_read_drive(ctl, families, arguments[0], false, &drive);
	if (status == DB_CTL_OK && count > 1)
		status = db_ctl_params_read_file(ctl, families, arguments[1], &file);
	if (status == DB_CTL_OK && count > 1)
		status = db_ctl_params_check_families(ctl, &drive, &file);
	if (status == DB_CTL_OK) {
		db_params_take_defaults(&drive, &defaults);
		if (ctl->json) {
			object = describe_set(&drive);
			(void)json_object_set(object, "defaults", defaults.values);
			if (drive.ages)
				(void)json_object_set(object, "ages_ms", drive.ages);
			if (count > 1)
				(void)json_object_set(object, "file", file.values);
			db_ctl_print_json(object);
			json_decref(object);
		} else {
			print_list(ctl, &drive, count > 1 ? &file : NULL, &defaults);
		}
	}
	db_params_clear(&drive);
	db_params_clear(&file);
	db_params_clear(&defaults);
	json_decref(families);
	return status;
}

/* --- save ------------------------------------------------------------------------------------- */

/* Takes the descriptor over. 0, or -1 with errno. */
static int write_text(int file, const char *text)
{
	FILE *out = fdopen(file, "w");
	int result = -1;
	int problem;

	if (!out) {
		problem = errno;
		(void)close(file);
	} else {
		/* A pipe, for instance, cannot be synchronized, and need not be. */
		if (fputs(text, out) >= 0 && fflush(out) == 0 &&
		    (fsync(file) == 0 || errno == EINVAL || errno == EROFS))
			result = 0;
		problem = errno;
		(void)fclose(out);
	}
	errno = problem;
	return result;
}

/* Leaves the old file or the new one, never a part, even after a power loss. 0, or -1 with
 * errno. */
static int replace_file(const char *path, mode_t mode, const char *text)
{
	char *folder = strdup(path);
	char *draft = NULL;
	int file = -1;
	int in = -1;
	int result = -1;
	int problem;

	if (folder && asprintf(&draft, "%s.XXXXXX", path) > 0)
		file = mkostemp(draft, O_CLOEXEC);
	if (file >= 0) {
		(void)fchmod(file, mode);
		result = write_text(file, text);
		if (result == 0)
			result = rename(draft, path);
		problem = errno;
		if (result != 0)
			(void)unlink(draft);
		errno = problem;
	}
	problem = errno;
	in = result == 0 ? open(dirname(folder), O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
	if (in >= 0) {
		(void)fsync(in);
		(void)close(in);
	}
	free(draft);
	free(folder);
	errno = problem;
	return result;
}

/* An existing path that is no regular file, such as a pipe, is written to and stays what it is. 0,
 * or -1 with errno. */
static int save_text(const char *path, const char *text)
{
	mode_t mask = umask(0);
	char *real = realpath(path, NULL);
	struct stat before;
	int result;
	int file;

	(void)umask(mask);
	if (!real || stat(real, &before) != 0) {
		result = replace_file(path, 0666 & ~mask, text);
	} else if (S_ISREG(before.st_mode)) {
		result = replace_file(real, before.st_mode & 07777, text);
	} else {
		file = open(real, O_WRONLY | O_CLOEXEC);
		result = file < 0 ? -1 : write_text(file, text);
	}
	free(real);
	return result;
}

static void print_names(const json_t *names)
{
	size_t i;
	const json_t *name;

	json_array_foreach(names, i, name)(void) fprintf(stderr, " %s", json_string_value(name));
	fputc('\n', stderr);
}

static void report_saved(const struct db_ctl *ctl, const struct db_params *drive, const char *path,
                         const json_t *untold)
{
	bool is_standard = strcmp(path, "-") == 0;
	json_t *object;

	if (ctl->json && !is_standard) {
		object = json_pack("{s:s, s:s, s:O, s:O?}", "drive", drive->name, "file", path,
		                   "not_told", untold, "missing", drive->missing);
		db_ctl_print_json(object);
		json_decref(object);
		return;
	}
	if (!is_standard)
		db_ctl_say_line(stdout, "%s: saved in %s", drive->name, path);
	(void)fflush(stdout);
	/* On standard error, because standard output may be the file. */
	if (json_array_size(untold) > 0) {
		fprintf(stderr, db_ctl_say("%s does not have or tell:"), drive->name);
		print_names(untold);
	}
	if (json_array_size(drive->missing) > 0) {
		fprintf(stderr, db_ctl_say("%s should have told, and did not:"), drive->name);
		print_names(drive->missing);
	}
}

static enum db_ctl_status save_set(const struct db_ctl *ctl, const struct db_params *drive,
                                   const char *path)
{
	enum db_ctl_status status = json_array_size(drive->missing) > 0 ? DB_CTL_NO : DB_CTL_OK;
	char *text = db_params_write(drive);
	json_t *untold = db_params_untold(drive);
	bool done = false;

	if (!text)
		status = db_ctl_complain(ctl, DB_CTL_NO, DB_CLIENT_NO_MEMORY, "out of memory");
	else if (strcmp(path, "-") == 0)
		done = fputs(text, stdout) >= 0;
	else if (save_text(path, text) == 0)
		done = true;
	else
		status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.BadFile", "%s: %s",
		                         path, strerror(errno));
	if (done)
		report_saved(ctl, drive, path, untold);
	json_decref(untold);
	free(text);
	return status;
}

enum db_ctl_status db_ctl_params_save(struct db_ctl *ctl, int count, char **arguments)
{
	struct db_params drive = { .values = NULL };
	enum db_ctl_status status;
	json_t *families = db_ctl_read_families(ctl, &status);
	char path[sizeof(drive.name) + sizeof(".params")];

	snprintf(path, sizeof(path), "%s.params", arguments[0]);
	if (status == DB_CTL_OK)
		status = db_ctl_params_read_drive(ctl, families, arguments[0], true, &drive);
	if (status == DB_CTL_OK)
		status = save_set(ctl, &drive, count > 1 ? arguments[1] : path);
	db_params_clear(&drive);
	json_decref(families);
	return status;
}

/* --- diff ------------------------------------------------------------------------------------- */

/* The number of a drive's parameters without a known default. */
static size_t count_without_default(const struct db_params *defaults)
{
	size_t count = 0;
	size_t i;
	const json_t *reg;

	json_array_foreach(defaults->registers, i, reg)
		count += db_params_is_kept(reg) &&
	                                 !db_params_value(defaults, db_words_text(reg, "name")) ?
	                         1 :
	                         0;
	return count;
}

static void print_differences(const struct db_ctl *ctl, const struct db_params *one,
                              const struct db_params *other, const json_t *differ)
{
	const json_t *registers = one->registers ? one->registers : other->registers;
	struct db_ctl_grid *grid = db_ctl_grid_new("lrrl");
	json_t *objects = json_array();
	json_t *object;
	size_t i;
	const json_t *item;

	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_ctl_say("NAME"));
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", one->name);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", other->name);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_ctl_say("UNIT"));
	json_array_foreach(differ, i, item)
	{
		const char *name = json_string_value(item);
		const json_t *reg = db_words_look_up(registers, name);
		const json_t *value = db_params_value(one, name);
		const json_t *beside = db_params_value(other, name);

		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", name);
		add_bare(grid, DB_CTL_BOLD, reg, value);
		add_bare(grid, DB_CTL_BOLD, reg, beside);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(reg, "unit"));
		(void)json_array_append_new(objects, json_pack("{s:s, s:O?, s:O?, s:s}", "name",
		                                               name, "one", value, "other", beside,
		                                               "unit", db_words_text(reg, "unit")));
	}
	if (ctl->json) {
		object = json_pack("{s:s, s:s, s:O}", "one", one->name, "other", other->name,
		                   "differences", objects);
		db_ctl_print_json(object);
		json_decref(object);
	} else if (json_array_size(differ) > 0) {
		db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	}
	json_decref(objects);
	db_ctl_grid_free(grid);
}

/* One of both may be the defaults; its family is then that of the other one. */
static enum db_ctl_status read_both(struct db_ctl *ctl, const json_t *families, char **names,
                                    struct db_params *sets)
{
	const json_t *drives = json_object_get(ctl->description, "drives");
	enum db_ctl_status status = DB_CTL_OK;
	bool are_default[2];

	for (int i = 0; i < 2; i++)
		are_default[i] = strcmp(names[i], "default") == 0;
	if (are_default[0] && are_default[1])
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "defaults of which drive or file?");
	for (int i = 0; i < 2 && status == DB_CTL_OK; i++) {
		if (!are_default[i] && db_words_look_up(drives, names[i]))
			status = db_ctl_params_read_drive(ctl, families, names[i], true, &sets[i]);
		else if (!are_default[i])
			status = db_ctl_params_read_file(ctl, families, names[i], &sets[i]);
	}
	for (int i = 0; i < 2 && status == DB_CTL_OK; i++) {
		if (are_default[i])
			db_params_take_defaults(&sets[1 - i], &sets[i]);
		if (are_default[i] && !sets[i].registers)
			status = db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			                         "no drive here is %s: its defaults are not known",
			                         sets[1 - i].family);
	}
	if (status == DB_CTL_OK && !are_default[0] && !are_default[1])
		status = db_ctl_params_check_families(ctl, &sets[0], &sets[1]);
	return status;
}

enum db_ctl_status db_ctl_params_diff(struct db_ctl *ctl, int count, char **arguments)
{
	struct db_params sets[2] = { { .values = NULL }, { .values = NULL } };
	enum db_ctl_status status;
	json_t *families = db_ctl_read_families(ctl, &status);
	json_t *differ = NULL;
	size_t open;

	(void)count;
	if (status == DB_CTL_OK)
		status = read_both(ctl, families, arguments, sets);
	if (status == DB_CTL_OK) {
		differ = db_params_compare(&sets[0], &sets[1]);
		print_differences(ctl, &sets[0], &sets[1], differ);
		for (int i = 0; i < 2; i++) {
			open = strcmp(sets[i].name, "default") == 0 ?
			               count_without_default(&sets[i]) :
			               0;
			if (open > 0 && !ctl->json)
				db_ctl_say_line(stderr, "of %zu others no default is documented",
				                open);
		}
		status = json_array_size(differ) > 0 ? DB_CTL_NO : DB_CTL_OK;
	} else if (status == DB_CTL_NO) {
		/* As diff(1): 1 means that they differ. */
		status = DB_CTL_USAGE;
	}
	json_decref(differ);
	db_params_clear(&sets[0]);
	db_params_clear(&sets[1]);
	json_decref(families);
	return status;
}
