/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <stdio.h>
#include <string.h>

static void print_names(const json_t *list, bool writable, const char *end)
{
	size_t i;
	const json_t *item;

	json_array_foreach(list, i, item)
	{
		if (!writable || json_is_true(json_object_get(item, "writable")))
			printf("%s%s\n", db_words_text(item, "name"), end);
	}
}

/* DRIVE.NAME of all drives. */
static enum db_ctl_status print_values(struct db_ctl *ctl)
{
	enum db_ctl_status status = DB_CTL_OK;
	size_t i;
	const json_t *drive;

	json_array_foreach(json_object_get(ctl->description, "drives"), i, drive)
	{
		json_t *registers = db_ctl_read_registers(ctl, db_words_text(drive, "name"),
		                                          &status);
		size_t j;
		const json_t *reg;

		json_array_foreach(registers, j, reg)(void)
			printf("%s.%s\n", db_words_text(drive, "name"), db_words_text(reg, "name"));
		json_decref(registers);
	}
	return status;
}

/* The words that may come next on the command line, one per line, for the shells' completion: after
 * a drive its commands ... */
enum db_ctl_status db_ctl_names(struct db_ctl *ctl, int count, char **arguments)
{
	const char *kind = arguments[0];
	const json_t *unit = count > 1 ? db_ctl_look_up_unit(ctl, arguments[1]) : NULL;
	const char *drive = db_words_text(unit, "name");
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer = NULL;
	json_t *command;
	size_t i;
	const json_t *name;

	if (strcmp(kind, "drives") == 0 || strcmp(kind, "units") == 0) {
		print_names(json_object_get(ctl->description, "drives"), false, "");
		if (kind[0] == 'u')
			puts("gateway");
	} else if (strcmp(kind, "buses") == 0) {
		print_names(json_object_get(ctl->description, "buses"), false, "");
	} else if (strcmp(kind, "values") == 0) {
		return print_values(ctl);
	} else if (!unit) {
		return DB_CTL_USAGE; /* nothing follows an unknown name */
	} else if (strcmp(kind, "registers") == 0 || strcmp(kind, "writable") == 0) {
		answer = db_ctl_read_registers(ctl, drive, &status);
		print_names(answer, kind[0] == 'w', kind[0] == 'w' ? "=" : "");
	} else if (strcmp(kind, "deeds") == 0) {
		puts("teach\ngo\nforget\nkeep");
	} else if (strcmp(kind, "positions") == 0) {
		answer = db_ctl_call(ctl, "Positions", json_pack("{s:s}", "drive", drive),
		                     DB_CTL_TIMEOUT_MS, &status);
		print_names(json_object_get(answer, "positions"), false, "");
	} else {
		answer = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", drive),
		                     DB_CTL_TIMEOUT_MS, &status);
		command = count > 2 ? db_words_look_up(json_object_get(answer, "commands"),
		                                       arguments[2]) :
		                      NULL;
		if (strcmp(kind, "commands") == 0)
			print_names(json_object_get(answer, "commands"), false, "");
		json_array_foreach(json_object_get(command, "arguments"), i, name)(void)
			printf("%s=\n", json_string_value(name));
	}
	json_decref(answer);
	return status;
}
