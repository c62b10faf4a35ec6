/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>

/* The registers shown for a bus, by name. Times in microseconds, load in thousandths. */
static const struct {
	const char *head;
	const char *name;
	const char *highest; /* shown after it */
	enum { MICROSECONDS, THOUSANDTHS, COUNT } kind;
} columns[] = {
	{ DB_CTL_TEXT("CYCLE"), "cycle_us", "cycle_max_us", MICROSECONDS },
	{ DB_CTL_TEXT("OF"), "period_us", NULL, MICROSECONDS },
	{ DB_CTL_TEXT("JITTER"), "jitter_us", "jitter_max_us", MICROSECONDS },
	{ DB_CTL_TEXT("LOAD"), "utilisation", NULL, THOUSANDTHS },
	{ DB_CTL_TEXT("OVERRUNS"), "overruns", NULL, COUNT },
	{ DB_CTL_TEXT("EXCHANGES"), "transactions", NULL, COUNT },
	{ DB_CTL_TEXT("REPEATED"), "retries", NULL, COUNT },
	{ DB_CTL_TEXT("NO ANSWER"), "timeouts", NULL, COUNT },
	{ DB_CTL_TEXT("BAD"), "bad_frames", NULL, COUNT },
};

static void add_time(struct db_ctl_grid *grid, const json_t *value, const json_t *highest)
{
	double ms = json_number_value(value) / 1000;

	if (!json_is_number(value))
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
	else if (json_is_number(highest))
		db_ctl_grid_add(grid, DB_CTL_PLAIN, db_ctl_say("%.2f, at most %.2f ms"), ms,
		                json_number_value(highest) / 1000);
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.2f ms", ms);
}

static void add_bus(struct db_ctl_grid *grid, const json_t *bus, const json_t *figures)
{
	bool up = json_is_true(json_object_get(bus, "up"));

	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_words_text(bus, "name"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(bus, "protocol"));
	db_ctl_grid_add(grid, up ? DB_CTL_PLAIN : DB_CTL_RED, "%s",
	                up ? db_ctl_say("up") : db_ctl_say("down"));
	for (size_t i = 0; i < sizeof(columns) / sizeof(columns[0]); i++) {
		const json_t *value = json_object_get(figures, columns[i].name);

		if (columns[i].kind == MICROSECONDS)
			add_time(grid, value,
			         columns[i].highest ? json_object_get(figures, columns[i].highest) :
			                              NULL);
		else if (!json_is_number(value))
			db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
		else if (columns[i].kind == THOUSANDTHS)
			db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.1f %%",
			                json_number_value(value) / 10);
		else
			db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.0f", json_number_value(value));
	}
}

/* Round trips belong to the drives. */
static enum db_ctl_status add_drives(struct db_ctl *ctl, struct db_ctl_grid *grid, json_t *trips)
{
	static const char *const names[] = { "round_trip_us", "round_trip_min_us",
		                             "round_trip_mean_us", "round_trip_max_us" };
	json_t *wanted = json_pack("[s,s,s,s,s]", names[0], names[1], names[2], names[3],
	                           "retries");
	enum db_ctl_status status = DB_CTL_OK;
	size_t i;
	const json_t *drive;

	json_array_foreach(json_object_get(ctl->description, "drives"), i, drive)
	{
		const char *name = db_words_text(drive, "name");
		json_t *answer = db_ctl_call(
			ctl, "Read", json_pack("{s:s, s:O}", "drive", name, "names", wanted),
			DB_CTL_TIMEOUT_MS, &status);
		json_t *values = json_object_get(answer, "values");

		if (status != DB_CTL_OK)
			break;
		db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", name);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(drive, "bus"));
		for (size_t at = 0; at < sizeof(names) / sizeof(names[0]); at++)
			add_time(grid, json_object_get(values, names[at]), NULL);
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.0f",
		                json_number_value(json_object_get(values, "retries")));
		(void)json_object_set(trips, name, values);
		json_decref(answer);
	}
	json_decref(wanted);
	return status;
}

enum db_ctl_status db_ctl_bus(struct db_ctl *ctl, int count, char **arguments)
{
	static const char *const heads[] = { DB_CTL_TEXT("DRIVE"),      DB_CTL_TEXT("BUS"),
		                             DB_CTL_TEXT("ROUND TRIP"), DB_CTL_TEXT("LEAST"),
		                             DB_CTL_TEXT("MEAN"),       DB_CTL_TEXT("MOST"),
		                             DB_CTL_TEXT("REPEATED") };
	static const char *const of_bus[] = { DB_CTL_TEXT("BUS"), DB_CTL_TEXT("PROTOCOL"),
		                              DB_CTL_TEXT("PORT") };
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Figures", NULL, DB_CTL_TIMEOUT_MS, &status);
	json_t *figures = json_object_get(answer, "buses");
	struct db_ctl_grid *grid = db_ctl_grid_new("lllrrrrrrrrr");
	struct db_ctl_grid *drives = db_ctl_grid_new("llrrrrr");
	json_t *trips = json_object();
	json_t *object;
	size_t i;
	const json_t *bus;

	(void)count;
	(void)arguments;
	if (status == DB_CTL_OK && grid && drives) {
		db_ctl_grid_add_heads(grid, of_bus, sizeof(of_bus) / sizeof(of_bus[0]));
		for (i = 0; i < sizeof(columns) / sizeof(columns[0]); i++)
			db_ctl_grid_add_heads(grid, &columns[i].head, 1);
		json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
			add_bus(grid, bus, json_object_get(figures, db_words_text(bus, "name")));
		db_ctl_grid_add_heads(drives, heads, sizeof(heads) / sizeof(heads[0]));
		status = add_drives(ctl, drives, trips);
	}
	if (status == DB_CTL_OK && ctl->json) {
		object = json_pack("{s:O?, s:O}", "buses", figures, "drives", trips);
		db_ctl_print_json(object);
		json_decref(object);
	} else if (status == DB_CTL_OK && grid && drives) {
		db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
		putchar('\n');
		db_ctl_grid_print(drives, ctl->colour, 0, "\n", stdout);
	}
	db_ctl_grid_free(grid);
	db_ctl_grid_free(drives);
	json_decref(trips);
	json_decref(answer);
	return status;
}
