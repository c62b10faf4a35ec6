/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/status.h"
#include "ctl/plant.h"
#include "ctl/value.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>

struct row {
	const json_t *drive; /* of the description */
	const json_t *registers;
	json_t *values;
	struct db_ctl_judgement judgement;
	size_t place; /* in the configuration */
};

static void keep_values(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct row *row = data;

	(void)more;
	/* A drive that went between two calls is one that does not answer. */
	row->values = error ? NULL : json_incref(json_object_get(parameters, "values"));
}

/* All drives at once: one round trip, however many there are. */
static enum db_ctl_status read_all(struct db_ctl *ctl, struct row *rows, size_t count)
{
	struct pollfd poll_fd = { .fd = db_client_fd(ctl->client) };

	for (size_t i = 0; i < count; i++) {
		json_t *parameters = json_pack("{s:s, s:o}", "drive",
		                               db_ctl_text(rows[i].drive, "name"), "names",
		                               db_ctl_process_names(rows[i].registers));

		(void)db_client_send(ctl->client, "Read", parameters, false, keep_values, &rows[i]);
	}
	while (db_client_waiting(ctl->client) > 0) {
		poll_fd.events = db_client_poll_events(ctl->client);
		if (poll(&poll_fd, 1, DB_CTL_TIMEOUT_MS) <= 0)
			return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_TIMEOUT,
			                       "the service does not answer within %d ms",
			                       DB_CTL_TIMEOUT_MS);
		if (db_client_handle(ctl->client) != 0)
			return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
			                       "the service has closed the connection");
	}
	return DB_CTL_OK;
}

/* The worst first, else as configured. */
static int compare_rows(const void *a, const void *b)
{
	const struct row *one = a;
	const struct row *other = b;

	if (one->judgement.need != other->judgement.need)
		return one->judgement.need > other->judgement.need ? -1 : 1;
	return one->place < other->place ? -1 : 1;
}

static json_t *describe_row(const struct row *row)
{
	static const char *const needs[] = { "nothing", "hint", "look", "act" };
	json_t *object = json_deep_copy(row->drive);
	const json_t *state = json_object_get(row->values, "axis_state");
	const char *state_name = json_is_integer(state) ?
	                                 db_ctl_code_name(
						 db_ctl_look_up(row->registers, "axis_state"),
						 json_integer_value(state)) :
	                                 NULL;

	(void)json_object_set_new(object, "state",
	                          state_name ? json_string(state_name) : json_null());
	(void)json_object_set_new(object, "need", json_string(needs[row->judgement.need]));
	(void)json_object_set_new(object, "why", json_string(row->judgement.why));
	(void)json_object_set_new(object, "next", json_string(row->judgement.next));
	(void)json_object_set_new(object, "values",
	                          row->values ? json_incref(row->values) : json_object());
	return object;
}

static void print_as_json(const struct db_ctl *ctl, const struct row *rows, size_t count, bool well)
{
	static const char *const of_configuration[] = {
		"configuration_state",
		"configuration_since_us",
		"configuration_messages",
	};
	json_t *buses = json_object_get(ctl->description, "buses");
	json_t *drives = json_array();
	json_t *object;

	for (size_t i = 0; i < count; i++)
		(void)json_array_append_new(drives, describe_row(&rows[i]));
	object = json_pack("{s:s, s:s, s:b, s:O, s:o}", "version",
	                   db_ctl_text(ctl->description, "version"), "configuration",
	                   db_ctl_text(ctl->description, "configuration"), "well", well, "buses",
	                   buses, "drives", drives);
	for (size_t i = 0; i < sizeof(of_configuration) / sizeof(of_configuration[0]); i++) {
		json_t *value = json_object_get(ctl->description, of_configuration[i]);

		if (value)
			(void)json_object_set(object, of_configuration[i], value);
	}
	db_ctl_print_json(object);
	json_decref(object);
}

static void print_advice(const struct db_ctl *ctl, const char *kind, const char *name,
                         const struct db_ctl_judgement *judgement)
{
	enum db_ctl_colour colour = judgement->need == DB_CTL_ACT  ? DB_CTL_RED :
	                            judgement->need == DB_CTL_LOOK ? DB_CTL_YELLOW :
	                                                             DB_CTL_PLAIN;

	if (judgement->need != DB_CTL_FINE)
		(void)printf("%s%s%s%s: %s: %s\n", db_ctl_colour_begin(ctl->colour, colour), kind,
		             name, db_ctl_colour_end(ctl->colour, colour), judgement->why,
		             judgement->next);
}

/* What is wrong with it stands below, a line each. */
static void print_configuration(const struct db_ctl *ctl)
{
	struct db_ctl_judgement judgement;
	size_t i;
	const json_t *message;

	db_ctl_judge_configuration(ctl->description, &judgement);
	print_advice(ctl, "", "configuration", &judgement);
	if (judgement.need < DB_CTL_LOOK)
		return;
	json_array_foreach(json_object_get(ctl->description, "configuration_messages"), i,
	                   message)(void) printf("  %s\n", json_string_value(message));
}

static void print_for_people(const struct db_ctl *ctl, const struct row *rows, size_t count,
                             bool well)
{
	struct db_ctl_grid *grid = db_ctl_grid_new(DB_CTL_DRIVE_COLUMNS);
	struct db_ctl_judgement judgement;
	size_t i;
	const json_t *bus;

	if (!grid)
		return;
	if (count > 0)
		db_ctl_add_heads(grid);
	for (size_t at = 0; at < count; at++)
		db_ctl_add_drive(grid, rows[at].drive, rows[at].registers, rows[at].values,
		                 &rows[at].judgement);
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
	if (count == 0)
		(void)puts("no drives yet: the configuration has none, see drivebridge.conf(5)");
	else
		(void)putchar('\n');
	print_configuration(ctl);
	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		db_ctl_judge_bus(bus, &judgement);
		print_advice(ctl, "bus ", db_ctl_text(bus, "name"), &judgement);
	}
	for (size_t at = 0; at < count; at++)
		print_advice(ctl, "", db_ctl_text(rows[at].drive, "name"), &rows[at].judgement);
	if (well && count > 0)
		(void)printf("%sall is well%s\n", db_ctl_colour_begin(ctl->colour, DB_CTL_GREEN),
		             db_ctl_colour_end(ctl->colour, DB_CTL_GREEN));
}

enum db_ctl_status db_ctl_status(struct db_ctl *ctl, int count, char **arguments)
{
	json_t *drives = json_object_get(ctl->description, "drives");
	size_t drive_count = json_array_size(drives);
	struct row *rows = calloc(drive_count + 1, sizeof(*rows));
	enum db_ctl_status status = DB_CTL_OK;
	json_t *families = db_ctl_read_families(ctl, &status);
	struct db_ctl_judgement judgement;
	bool well = true;
	size_t i;
	const json_t *bus;

	(void)count;
	(void)arguments;
	for (i = 0; rows && i < drive_count; i++) {
		rows[i].drive = json_array_get(drives, i);
		rows[i].registers = db_ctl_registers_of(ctl, families, rows[i].drive);
		rows[i].place = i;
	}
	if (rows && status == DB_CTL_OK)
		status = read_all(ctl, rows, drive_count);
	if (rows && status == DB_CTL_OK) {
		for (i = 0; i < drive_count; i++) {
			db_ctl_judge_drive(rows[i].drive, rows[i].registers, rows[i].values,
			                   &rows[i].judgement);
			well = well && rows[i].judgement.need <= DB_CTL_HINT;
		}
		json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
		{
			db_ctl_judge_bus(bus, &judgement);
			well = well && judgement.need == DB_CTL_FINE;
		}
		db_ctl_judge_configuration(ctl->description, &judgement);
		well = well && judgement.need <= DB_CTL_HINT;
		qsort(rows, drive_count, sizeof(*rows), compare_rows);
		if (ctl->json)
			print_as_json(ctl, rows, drive_count, well);
		else
			print_for_people(ctl, rows, drive_count, well);
		status = well ? DB_CTL_OK : DB_CTL_NO;
	}
	for (i = 0; rows && i < drive_count; i++)
		json_decref(rows[i].values);
	free(rows);
	json_decref(families);
	return status;
}
