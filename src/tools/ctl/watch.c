/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "ctl/terminal.h"
#include "words/value.h"

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define FIGURES_EVERY_MS 1000

struct watch {
	struct db_ctl *ctl;
	/* A connection with a stream can make no other calls, so each purpose has its own. */
	struct db_client *figures_client;
	struct db_client *troubles_client;
	struct db_client_troubles troubles;
	json_t *families;
	json_t *drives;  /* names of those to show */
	json_t *values;  /* by drive */
	json_t *figures; /* by bus */
	bool asked;      /* the figures were asked for */
	bool changed;
	bool ended;
	enum db_ctl_status status;
};

static void take_samples(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct watch *watch = data;
	size_t i;
	const json_t *sample;

	watch->ended = !more;
	if (error) {
		watch->status = db_ctl_fail(watch->ctl, error);
		return;
	}
	if (watch->ctl->json)
		db_ctl_print_json(parameters);
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
	{
		(void)json_object_set(watch->values, db_words_text(sample, "drive"),
		                      json_object_get(sample, "values"));
	}
	watch->changed = true;
}

static void take_figures(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct watch *watch = data;

	(void)more;
	watch->asked = false;
	if (error)
		return;
	json_decref(watch->figures);
	watch->figures = json_incref(json_object_get(parameters, "buses"));
	if (watch->ctl->json)
		db_ctl_print_json(parameters);
	watch->changed = true;
}

static void take_troubles(void *data, json_t *parameters, const struct db_client_error *error,
                          bool more)
{
	struct watch *watch = data;

	(void)more;
	if (error)
		return;
	db_client_troubles_take(&watch->troubles, parameters);
	watch->changed = true;
}

/* One line for all buses. */
static void print_buses(const struct watch *watch, unsigned columns)
{
	char line[512];
	size_t used = 0;
	size_t i;
	const json_t *bus;

	line[0] = '\0';
	json_array_foreach(json_object_get(watch->ctl->description, "buses"), i, bus)
	{
		const json_t *figures = json_object_get(watch->figures, db_words_text(bus, "name"));

		if (used < sizeof(line))
			used += (size_t)snprintf(
				line + used, sizeof(line) - used,
				db_ctl_say("%s%s: load %.0f %%, cycle %.1f ms"), i > 0 ? "   " : "",
				db_words_text(bus, "name"),
				json_number_value(json_object_get(figures, "utilisation")) / 10,
				json_number_value(json_object_get(figures, "cycle_us")) / 1000);
	}
	printf("%.*s\033[K\r\n\033[K\r\n", db_words_fit(line, columns), line);
}

static void redraw(struct watch *watch)
{
	struct db_ctl_grid *grid = db_ctl_grid_new(DB_CTL_DRIVE_COLUMNS);
	struct db_ctl_judgement judgement;
	unsigned lines = 24;
	unsigned columns = 80;
	time_t now = time(NULL);
	const char *title = db_ctl_say("drivebridge  (q ends)");
	char clock[16] = "";
	struct tm local;
	size_t i;
	const json_t *drive;

	if (!grid)
		return;
	db_ctl_terminal_size(&lines, &columns);
	if (localtime_r(&now, &local))
		(void)strftime(clock, sizeof(clock), "%H:%M:%S", &local);
	printf("\033[H%.*s\033[K\r\n", db_words_fit(title, columns), title);
	printf("\033[1;%uH%s\r\n", columns > 9 ? columns - 8 : 1, clock);
	print_buses(watch, columns);
	db_ctl_add_heads(grid);
	json_array_foreach(watch->drives, i, drive)
	{
		const json_t *registers = db_ctl_registers_of(watch->ctl, watch->families, drive);
		const json_t *values = json_object_get(watch->values, db_words_text(drive, "name"));

		/* Heads and buses take four lines; rows that do not fit are left out. */
		if (i + 5 > lines)
			break;
		db_ctl_judge(json_object_get(watch->troubles.drives, db_words_text(drive, "name")),
		             &judgement);
		db_ctl_add_drive(grid, drive, registers, values, &judgement);
	}
	db_ctl_fit_drives(grid, columns);
	db_ctl_grid_print(grid, watch->ctl->colour, columns, "\033[K\r\n", stdout);
	printf("\033[J");
	(void)fflush(stdout);
	db_ctl_grid_free(grid);
	watch->changed = false;
}

/* False when the user ends it. */
static bool read_keys(const struct pollfd *terminal)
{
	char bytes[64];
	size_t at = 0;
	ssize_t count;
	enum db_ctl_key key;

	if (terminal->revents == 0)
		return true;
	count = read(STDIN_FILENO, bytes, sizeof(bytes));
	if (count <= 0)
		return false;
	while ((key = db_ctl_terminal_next_key(bytes, (size_t)count, &at)) != DB_CTL_KEY_NONE) {
		if (key == DB_CTL_KEY_QUIT)
			return false;
	}
	return true;
}

static void run_watch(struct watch *watch, int signals)
{
	struct pollfd fds[] = {
		{ .fd = -1 },
		{ .fd = signals, .events = POLLIN },
		{ .fd = -1 },
		/* A script's stream has no keys. */
		{ .fd = watch->ctl->json ? -1 : STDIN_FILENO, .events = POLLIN },
		{ .fd = -1 },
	};
	int signal_number;
	time_t asked_at = 0;

	while (!watch->ended) {
		fds[0] = db_client_poll_fd(watch->ctl->client);
		if (watch->figures_client)
			fds[2] = db_client_poll_fd(watch->figures_client);
		fds[4] = db_client_poll_fd(watch->troubles_client);
		(void)poll(fds, sizeof(fds) / sizeof(fds[0]), FIGURES_EVERY_MS);
		signal_number = db_ctl_signals_read(signals);
		watch->changed = watch->changed || signal_number == SIGWINCH;
		if ((signal_number != 0 && signal_number != SIGWINCH) || !read_keys(&fds[3]) ||
		    ferror(stdout))
			break;
		(void)db_client_handle(watch->ctl->client);
		if (db_client_handle(watch->troubles_client) != 0)
			fds[4].fd = -1;
		if (watch->figures_client && db_client_handle(watch->figures_client) == 0 &&
		    !watch->asked && time(NULL) != asked_at) {
			asked_at = time(NULL);
			watch->asked = db_client_send(watch->figures_client, "Figures", NULL, false,
			                              take_figures, watch) == 0;
		}
		if (watch->changed && !watch->ctl->json && db_ctl_terminal_takes_output())
			redraw(watch);
	}
}

/* The drives of the command line, or all. */
static enum db_ctl_status choose_drives(struct watch *watch, int count, char **arguments)
{
	json_t *all = json_object_get(watch->ctl->description, "drives");
	json_t *drive;

	if (count == 0) {
		(void)json_array_extend(watch->drives, all);
		return DB_CTL_OK;
	}
	for (int i = 0; i < count; i++) {
		drive = db_ctl_find_drive(watch->ctl, arguments[i]);
		if (!drive)
			return DB_CTL_USAGE;
		(void)json_array_append(watch->drives, drive);
	}
	return DB_CTL_OK;
}

static int subscribe(struct watch *watch, int interval)
{
	const json_t *registers = db_ctl_registers_of(watch->ctl, watch->families,
	                                              json_array_get(watch->drives, 0));
	json_t *names = json_array();
	size_t i;
	const json_t *drive;
	json_t *parameters;

	json_array_foreach(watch->drives, i, drive)
	{
		(void)json_array_append(names, json_object_get(drive, "name"));
	}
	parameters = json_pack("{s:o, s:o, s:i}", "drives", names, "names",
	                       db_ctl_process_names(registers), "interval_ms", interval);
	return db_client_send(watch->ctl->client, "Subscribe", parameters, true, take_samples,
	                      watch);
}

enum db_ctl_status db_ctl_watch(struct db_ctl *ctl, int count, char **arguments)
{
	struct watch watch = { .ctl = ctl, .drives = json_array(), .values = json_object() };
	struct db_client_error error = { .parameters = NULL };
	struct db_ctl_terminal terminal = { .open = false };
	int interval = ctl->interval ? atoi(ctl->interval) : 200;
	int signals = -1;

	watch.status = choose_drives(&watch, count, arguments);
	if (watch.status == DB_CTL_OK)
		watch.families = db_ctl_read_families(ctl, &watch.status);
	if (watch.status == DB_CTL_OK &&
	    (db_client_open(ctl->socket, &watch.figures_client, &error) != 0 ||
	     db_client_open(ctl->socket, &watch.troubles_client, &error) != 0))
		watch.status = db_ctl_fail(ctl, &error);
	if (watch.status == DB_CTL_OK) {
		signals = db_ctl_signals_open();
		if (!ctl->json && !db_ctl_terminal_open(&terminal, true))
			watch.status = db_ctl_complain(
				ctl, DB_CTL_USAGE, "io.drivebridge.Client.NoTerminal",
				"watch needs a terminal; watch --json gives lines");
	}
	if (watch.status == DB_CTL_OK && subscribe(&watch, interval) == 0 &&
	    db_client_send(watch.troubles_client, "Troubles", json_pack("{s:[]}", "drives"), true,
	                   take_troubles, &watch) == 0)
		run_watch(&watch, signals);
	db_ctl_terminal_close(&terminal);
	if (signals >= 0)
		(void)close(signals);
	/* Late answers would write into this function's memory. */
	db_client_close(watch.figures_client);
	db_client_close(watch.troubles_client);
	db_client_troubles_clear(&watch.troubles);
	db_client_close(ctl->client);
	ctl->client = NULL;
	db_client_error_clear(&error);
	json_decref(watch.families);
	json_decref(watch.drives);
	json_decref(watch.values);
	json_decref(watch.figures);
	return watch.status;
}
