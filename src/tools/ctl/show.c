/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdint.h>
#include <string.h>

/* The values of these names, or of the process data if the array is empty; takes the names over. */
static json_t *read_values(struct db_ctl *ctl, const char *drive, json_t *names,
                           enum db_ctl_status *status)
{
	json_t *answer = db_ctl_call(ctl, "Read",
	                             json_pack("{s:s, s:o}", "drive", drive, "names", names),
	                             DB_CTL_DRIVE_TIMEOUT_MS, status);
	json_t *values = json_incref(json_object_get(answer, "values"));

	json_decref(answer);
	return values;
}

/* The discrete input with bit 0 of drive_status; the others follow it (docs/register-map.md). */
#define FIRST_DRIVE_BIT 64

/* The drive's own status word has the names of the discrete inputs that hold its bits. */
static void write_drive_status(const json_t *registers, const json_t *value, char *text,
                               size_t size)
{
	uint64_t bits = (uint64_t)json_integer_value(value);
	size_t used = (size_t)snprintf(text, size, "%s", bits == 0 ? "none" : "");
	size_t i;
	const json_t *reg;

	json_array_foreach(registers, i, reg)
	{
		const char *name = db_words_text(reg, "name");
		json_int_t bit = json_integer_value(json_object_get(reg, "address")) -
		                 FIRST_DRIVE_BIT;

		if (used < size && strcmp(db_words_text(reg, "table"), "discrete") == 0 &&
		    strncmp(name, "drive_", 6) == 0 && bit >= 0 && bit < 32 && bits >> bit & 1)
			used += (size_t)snprintf(text + used, size - used, "%s%s",
			                         used > 0 ? ", " : "", name + 6);
	}
}

static void print_values(const struct db_ctl *ctl, const json_t *registers, const json_t *values,
                         bool parameters, const char *head)
{
	struct db_ctl_grid *grid = db_ctl_grid_new("lll");
	char text[DB_WORDS_VALUE_MAX];
	char meaning[DB_WORDS_MEANING_MAX];
	char room[DB_WORDS_TEXT_MAX];
	size_t used;
	size_t i;
	const json_t *reg;
	const char *description;
	bool any = false;

	if (!grid)
		return;
	json_array_foreach(registers, i, reg)
	{
		const char *name = db_words_text(reg, "name");
		const json_t *value = json_object_get(values, name);

		if (!value || (parameters != json_is_true(json_object_get(reg, "parameter"))))
			continue;
		description = db_ctl_translate(db_words_text(reg, "description"), room);
		if (strcmp(name, "drive_status") == 0)
			write_drive_status(registers, value, text, sizeof(text));
		else
			db_words_write_value(reg, value, text, sizeof(text));
		used = strlen(text);
		if (db_words_meaning(reg, description, value, meaning, sizeof(meaning)))
			snprintf(text + used, sizeof(text) - used, " (%s)", meaning);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "  %s", name);
		db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", text);
		/* The codes and conditions after the first words are printed only in the full
		 * list. */
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.*s",
		                ctl->all   ? (int)strlen(description) :
		                parameters ? (int)strcspn(description, ":;") :
		                             0,
		                description);
		any = true;
	}
	if (any)
		printf("%s\n", head);
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

static void print_head(const struct db_ctl *ctl, const json_t *drive)
{
	json_t *buses = json_object_get(ctl->description, "buses");
	const json_t *bus = db_words_look_up(buses, db_words_text(drive, "bus"));
	const char *axis = db_words_text(drive, "axis");
	const char *endpoint = db_words_text(drive, "endpoint");

	if (drive == ctl->gateway) {
		printf("%s%s%s: drivebridge %s, %s\n\n",
		       db_ctl_colour_begin(ctl->colour, DB_CTL_BOLD), db_ctl_say("gateway"),
		       db_ctl_colour_end(ctl->colour, DB_CTL_BOLD),
		       db_words_text(ctl->description, "version"),
		       db_words_text(ctl->description, "configuration"));
		return;
	}
	printf("%s%s%s: ", db_ctl_colour_begin(ctl->colour, DB_CTL_BOLD),
	       db_words_text(drive, "name"), db_ctl_colour_end(ctl->colour, DB_CTL_BOLD));
	db_ctl_say_line(stdout, "%s on bus %s (%s), address %lld%s%s, unit %lld%s%s",
	                db_words_text(bus, "protocol"), db_words_text(drive, "bus"),
	                db_words_text(bus, "device"),
	                (long long)json_integer_value(json_object_get(drive, "address")),
	                axis[0] ? db_ctl_say(" axis ") : "", axis,
	                (long long)json_integer_value(json_object_get(drive, "unit")),
	                endpoint[0] ? db_ctl_say(" of endpoint ") : "", endpoint);
	putchar('\n');
}

enum db_ctl_status db_ctl_show(struct db_ctl *ctl, int count, char **arguments)
{
	const json_t *drive = db_ctl_find_unit(ctl, arguments[0]);
	const char *name = db_words_text(drive, "name");
	enum db_ctl_status status = DB_CTL_OK;
	json_t *registers = NULL;
	json_t *values = NULL;
	json_t *names = json_array();
	json_t *others = NULL;
	json_t *object;
	size_t i;
	const json_t *reg;

	(void)count;
	if (!drive) {
		json_decref(names);
		return DB_CTL_USAGE;
	}
	registers = db_ctl_read_registers(ctl, name, &status);
	json_array_foreach(registers, i, reg)
	{
		if (ctl->all || json_is_true(json_object_get(reg, "parameter")))
			(void)json_array_append(names, json_object_get(reg, "name"));
	}
	if (status == DB_CTL_OK)
		values = read_values(ctl, name, json_array(), &status);
	if (status == DB_CTL_OK && json_array_size(names) > 0)
		others = read_values(ctl, name, json_incref(names), &status);
	if (status == DB_CTL_OK) {
		(void)json_object_update_missing(values, others);
		if (ctl->json) {
			object = json_pack("{s:O, s:O, s:O}", "drive", drive, "values", values,
			                   "registers", registers);
			db_ctl_print_json(object);
			json_decref(object);
		} else {
			print_head(ctl, drive);
			print_values(ctl, registers, values, false, db_ctl_say("values"));
			putchar('\n');
			print_values(ctl, registers, values, true, db_ctl_say("parameters"));
		}
	}
	json_decref(names);
	json_decref(others);
	json_decref(values);
	json_decref(registers);
	return status;
}

enum db_ctl_status db_ctl_get(struct db_ctl *ctl, int count, char **arguments)
{
	const json_t *drive = db_ctl_find_unit(ctl, arguments[0]);
	const char *name = db_words_text(drive, "name");
	enum db_ctl_status status = DB_CTL_OK;
	json_t *registers = NULL;
	json_t *values = NULL;
	json_t *names = json_array();
	json_t *object;
	char text[DB_WORDS_VALUE_MAX];

	if (drive)
		registers = db_ctl_read_registers(ctl, name, &status);
	else
		status = DB_CTL_USAGE;
	snprintf(text, sizeof(text), "%s has no register", arguments[0]);
	for (int i = 1; i < count && status == DB_CTL_OK; i++) {
		if (!db_ctl_find(ctl, registers, arguments[i], DB_CLIENT_SERVICE "NoSuchRegister",
		                 text))
			status = DB_CTL_USAGE;
		(void)json_array_append_new(names, json_string(arguments[i]));
	}
	if (status == DB_CTL_OK)
		values = read_values(ctl, name, json_incref(names), &status);
	if (status == DB_CTL_OK && ctl->json) {
		object = json_pack("{s:s, s:O}", "drive", arguments[0], "values", values);
		db_ctl_print_json(object);
		json_decref(object);
	}
	for (int i = 1; i < count && status == DB_CTL_OK && !ctl->json; i++) {
		db_words_write_value(db_words_look_up(registers, arguments[i]),
		                     json_object_get(values, arguments[i]), text, sizeof(text));
		/* With one name print only its value, as scripts need it. */
		if (count == 2)
			puts(text);
		else
			printf("%s = %s\n", arguments[i], text);
	}
	json_decref(names);
	json_decref(values);
	json_decref(registers);
	return status;
}
