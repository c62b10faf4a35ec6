/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "ctl/search.h"
#include "setup/sections.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Some drives need longer than this before they answer. */
#define WAIT_SHORT_US 10000

static const char *verdict_of(const json_t *find)
{
	return db_words_text(find, "verdict");
}

/* --- the table -------------------------------------------------------------------------------- */

static void add_time(struct db_ctl_grid *grid, const json_t *find, const char *name)
{
	if (db_words_number(find, "answered") == 0)
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.1f ms",
		                (double)db_words_number(find, name) / 1000);
}

static void add_find(struct db_ctl_grid *grid, const json_t *find, const json_t *bus)
{
	char identity[DB_WORDS_VALUE_MAX];
	const char *other = db_words_text(find, "other");
	const char *verdict = verdict_of(find);
	char place[DB_WORDS_VALUE_MAX];
	size_t used = 0;
	size_t i;
	const json_t *name;

	snprintf(identity, sizeof(identity), "%s%s%s", db_words_text(find, "identity"),
	         other[0] ? db_ctl_say(" and ") : "", other);
	db_words_clean(identity);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%lld", (long long)db_words_number(find, "address"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld", (long long)db_words_number(find, "speed"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(bus, "protocol"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", identity[0] ? identity : "-");
	add_time(grid, find, "time_min_us");
	add_time(grid, find, "time_mean_us");
	add_time(grid, find, "time_max_us");
	/* Its name in the configuration. */
	snprintf(place, sizeof(place), "%s", db_ctl_say("new"));
	json_array_foreach(json_object_get(find, "drives"), i, name)
	{
		if (used < sizeof(place))
			used += (size_t)snprintf(place + used, sizeof(place) - used, "%s%s",
			                         i > 0 ? ", " : "", json_string_value(name));
	}
	if (strcmp(verdict, "one") == 0)
		db_ctl_grid_add(grid, used > 0 ? DB_CTL_PLAIN : DB_CTL_GREEN, "%s", place);
	else
		db_ctl_grid_add(grid, DB_CTL_RED, "%s%s%s",
		                strcmp(verdict, "two") == 0 ? db_ctl_say("two drives") :
		                                              db_ctl_say("nothing readable"),
		                used > 0 ? ": " : "", used > 0 ? place : "");
}

static void print_table(const struct db_ctl *ctl, const struct db_ctl_search *search,
                        const json_t *bus)
{
	static const char *const heads[] = {
		DB_CTL_TEXT("ADDRESS"),  DB_CTL_TEXT("BIT/S"),        DB_CTL_TEXT("PROTOCOL"),
		DB_CTL_TEXT("IDENTITY"), DB_CTL_TEXT("FASTEST"),      DB_CTL_TEXT("MEAN"),
		DB_CTL_TEXT("SLOWEST"),  DB_CTL_TEXT("CONFIGURED AS")
	};
	struct db_ctl_grid *grid = db_ctl_grid_new("rrllrrrl");
	size_t i;
	const json_t *find;

	if (!grid)
		return;
	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
	json_array_foreach(search->finds, i, find) add_find(grid, find, bus);
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

/* Prints what the user has to do about it. */
static void print_advice(const struct db_ctl_search *search)
{
	size_t i;
	const json_t *find;

	json_array_foreach(search->finds, i, find)
	{
		long long address = (long long)db_words_number(find, "address");

		if (strcmp(verdict_of(find), "one") != 0)
			putchar('\n');
		if (strcmp(verdict_of(find), "two") == 0)
			db_ctl_say_line(
				stdout,
				"address %lld: two drives have it. Take one of them off the "
				"line, give the other an address of its own with drivebridgectl "
				"address, and connect it again",
				address);
		else if (strcmp(verdict_of(find), "garbled") == 0)
			db_ctl_say_line(
				stdout,
				"address %lld: bytes were received, but no valid answer: two "
				"drives that talk at once, or a disturbed line. Take drives off "
				"the line one by one; check wires, termination and ground",
				address);
	}
	if (json_array_size(search->finds) == 0)
		db_ctl_say_line(stdout, "no drive answers: check power and wiring (A and B may be "
		                        "swapped), whether protocol and line are right, and the "
		                        "baud rate: --all-bauds tries all of them");
}

/* --- the command ------------------------------------------------------------------------------ */

static void print_found(const struct db_ctl *ctl, const struct db_ctl_search *search,
                        const json_t *bus)
{
	char *configuration = db_setup_write_sections(bus, search->finds,
	                                              json_object_get(ctl->description, "drives"));
	json_t *object;
	size_t i;
	const json_t *frame;

	if (ctl->json) {
		object = json_pack("{s:s, s:O, s:O, s:I, s:b, s:s}", "bus",
		                   db_words_text(bus, "name"), "finds", search->finds, "foreign",
		                   search->foreign, "wait_us", search->wait_us, "interrupted",
		                   search->interrupted, "configuration",
		                   configuration ? configuration : "");
		db_ctl_print_json(object);
		json_decref(object);
		free(configuration);
		return;
	}
	if (json_array_size(search->finds) > 0)
		print_table(ctl, search, bus);
	if (json_array_size(search->foreign) > 0) {
		putchar('\n');
		db_ctl_say_line(stdout,
		                "other frames on this bus, of nobody who is configured here:");
	}
	json_array_foreach(search->foreign, i, frame)
	{
		printf("  %0*llX ", json_is_true(json_object_get(frame, "extended")) ? 8 : 3,
		       (unsigned long long)db_words_number(frame, "id"));
		db_ctl_say_line(stdout, "%lld times", (long long)db_words_number(frame, "count"));
	}
	if (!search->interrupted)
		print_advice(search);
	if (search->wait_us < WAIT_SHORT_US) {
		putchar('\n');
		db_ctl_say_line(
			stdout,
			"each address was given %.1f ms to begin its answer, as much as the cycle "
			"leaves: a slower drive is found\nwith a longer cycle-ms, or with the "
			"bus out of service (--baud)",
			(double)search->wait_us / 1000);
	}
	if (configuration && configuration[0])
		printf("\n%s\n\n%s",
		       db_ctl_say("for the configuration, then drivebridgectl reload:"),
		       configuration);
	free(configuration);
}

/* The parameters of Scan, from the options; NULL, and the reason is printed. */
static json_t *read_options(const struct db_ctl *ctl, const char *bus)
{
	json_t *parameters = json_pack("{s:s, s:b}", "bus", bus, "all_speeds", ctl->all_speeds);
	int speed = ctl->speed ? atoi(ctl->speed) : 0;
	unsigned first;
	unsigned last;
	char end;

	if (ctl->speed)
		(void)json_object_set_new(parameters, "speeds", json_pack("[i]", speed));
	if (ctl->addresses && sscanf(ctl->addresses, "%u-%u%c", &first, &last, &end) == 2) {
		(void)json_object_set_new(parameters, "first", json_integer(first));
		(void)json_object_set_new(parameters, "last", json_integer(last));
	} else if (ctl->addresses) {
		(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                      "\"%s\" are no addresses; 1-32, for instance, are",
		                      ctl->addresses);
		json_decref(parameters);
		return NULL;
	}
	if (!ctl->speed || (speed > 0 && !ctl->all_speeds))
		return parameters;
	(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
	                      "--baud takes one number of bit/s, and goes without --all-bauds");
	json_decref(parameters);
	return NULL;
}

enum db_ctl_status db_ctl_scan(struct db_ctl *ctl, int count, char **arguments)
{
	const json_t *bus = db_ctl_find_bus(ctl, arguments[0]);
	json_t *parameters = bus ? read_options(ctl, arguments[0]) : NULL;
	bool aside = ctl->all_speeds || ctl->speed;
	struct db_ctl_search search;
	enum db_ctl_status status;

	(void)count;
	if (!parameters)
		return DB_CTL_USAGE;
	if (aside && !ctl->json)
		db_ctl_say_line(stdout,
		                "bus %s is taken out of service for this: its drives, which must "
		                "stand, are left as on-exit says, and\nare offline for every PLC "
		                "until the scan has ended",
		                arguments[0]);
	status = aside ? db_ctl_ask(ctl, "go on?") : DB_CTL_OK;
	if (status != DB_CTL_OK) {
		json_decref(parameters);
		return status;
	}
	status = db_ctl_search(ctl, parameters, &search);
	if (status == DB_CTL_OK)
		print_found(ctl, &search, bus);
	if (status == DB_CTL_OK && search.interrupted)
		status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
		                         "interrupted: the scan was ended");
	db_ctl_search_clear(&search);
	return status;
}
