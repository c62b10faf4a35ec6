/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/audit_text.h"
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* What was looked at so far. */
struct tally {
	json_int_t checked;
	json_int_t broken;
	json_int_t newest;
	bool kept;
};

/* --- times ------------------------------------------------------------------------------------ */

enum db_ctl_status db_ctl_read_since(const struct db_ctl *ctl, json_int_t *us)
{
	static const char *const forms[] = { "%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M:%S",
		                             "%Y-%m-%dT%H:%M", "%Y-%m-%d %H:%M", "%Y-%m-%d" };
	static const struct {
		char letter;
		double seconds;
	} units[] = { { 's', 1 }, { 'm', 60 }, { 'h', 3600 }, { 'd', 86400 } };
	const char *text = ctl->since;
	json_int_t found = 0;
	double number;
	char *rest;

	if (!text)
		return DB_CTL_OK;
	number = strtod(text, &rest);
	for (size_t i = 0; i < sizeof(units) / sizeof(units[0]); i++) {
		if (rest != text && rest[0] == units[i].letter && rest[1] == '\0' && number >= 0)
			found = (json_int_t)(((double)time(NULL) - number * units[i].seconds) *
			                     1e6);
	}
	for (size_t i = 0; found == 0 && i < sizeof(forms) / sizeof(forms[0]); i++) {
		struct tm moment = { .tm_isdst = -1 };
		const char *end = strptime(text, forms[i], &moment);

		if (end && *end == '\0')
			found = (json_int_t)mktime(&moment) * 1000000;
	}
	if (found == 0)
		return db_ctl_complain(
			ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			"--since is a time ago, such as 30m, 2h or 1d, or a date such as "
			"\"2026-05-01 14:00\"");
	*us = found;
	return DB_CTL_OK;
}

/* --- the command ------------------------------------------------------------------------------ */

static void add_row(struct db_ctl_grid *grid, const json_t *record)
{
	char when[DB_WORDS_TIME_MAX];
	char *line = db_capture_audit_describe(record);
	char *who = strdup(db_words_text(record, "who"));
	enum db_ctl_colour colour = json_object_get(record, "broken")   ? DB_CTL_RED :
	                            db_capture_audit_is_refused(record) ? DB_CTL_YELLOW :
	                                                                  DB_CTL_PLAIN;

	db_words_write_time(json_integer_value(json_object_get(record, "time_us")), when);
	if (who)
		db_words_clean(who);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld",
	                (long long)json_integer_value(json_object_get(record, "number")));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", when);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", who ? who : "?");
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_words_text(record, "drive"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", line ? line : "?");
	db_ctl_grid_add(grid, colour, "%s", db_ctl_say_name(db_words_text(record, "result")));
	free(line);
	free(who);
}

static void print_page(const struct db_ctl *ctl, const json_t *records)
{
	struct db_ctl_grid *grid = NULL;
	const json_t *record;
	size_t i;

	if (!ctl->json && !ctl->cef && json_array_size(records) > 0)
		grid = db_ctl_grid_new("rlllll");
	json_array_foreach(records, i, record)
	{
		if (ctl->json)
			db_ctl_print_json(record);
		else if (ctl->cef)
			db_capture_audit_write_cef(record, stdout);
		else if (grid)
			add_row(grid, record);
	}
	if (grid)
		db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

static void print_broken(const struct db_ctl *ctl, const json_t *page)
{
	char room[DB_WORDS_TEXT_MAX];
	const json_t *broken;
	size_t i;

	json_array_foreach(json_object_get(page, "broken"), i, broken)
	{
		if (ctl->json)
			db_ctl_print_json(broken);
		else
			db_ctl_say_line(
				stderr, "%s:%lld: near record %lld: %s",
				db_words_text(broken, "file"),
				(long long)json_integer_value(json_object_get(broken, "line")),
				(long long)json_integer_value(json_object_get(broken, "number")),
				db_ctl_translate(db_words_text(broken, "why"), room));
	}
}

/* All pages, one after the other. */
static enum db_ctl_status read_trail(struct db_ctl *ctl, bool verify, struct tally *tally)
{
	json_int_t since_us = 0;
	enum db_ctl_status status = db_ctl_read_since(ctl, &since_us);
	json_t *query;
	bool over = false;

	if (status != DB_CTL_OK)
		return status;
	query = json_pack("{s:I, s:b, s:b}", "since_us", since_us, "refused", ctl->refused,
	                  "verify", verify);
	if (ctl->drive)
		(void)json_object_set_new(query, "drive", json_string(ctl->drive));
	if (ctl->user)
		(void)json_object_set_new(query, "who", json_string(ctl->user));
	while (status == DB_CTL_OK && !over) {
		json_t *page = db_ctl_call(ctl, "Audit", json_incref(query), DB_CTL_TIMEOUT_MS,
		                           &status);
		const json_t *trail = json_object_get(page, "trail");

		if (status == DB_CTL_OK) {
			print_page(ctl, json_object_get(page, "records"));
			print_broken(ctl, page);
			tally->checked += json_integer_value(json_object_get(page, "checked"));
			tally->broken += (json_int_t)json_array_size(
						 json_object_get(page, "broken")) +
			                 json_integer_value(json_object_get(page, "more_broken"));
			tally->newest = json_integer_value(json_object_get(trail, "newest"));
			tally->kept = json_is_true(json_object_get(trail, "kept"));
			over = json_is_true(json_object_get(page, "over"));
			(void)json_object_set(query, "from", json_object_get(page, "next"));
		}
		json_decref(page);
	}
	json_decref(query);
	if (status == DB_CTL_OK && !tally->kept)
		return db_ctl_complain(
			ctl, DB_CTL_NO, "io.drivebridge.Client.NoTrail",
			"the service keeps no files of its audit trail; see audit in "
			"drivebridge.conf(5), and journalctl "
			"DRIVEBRIDGE_EVENT=audit");
	return status;
}

enum db_ctl_status db_ctl_audit(struct db_ctl *ctl, int count, char **arguments)
{
	struct tally tally = { .checked = 0 };
	enum db_ctl_status status = read_trail(ctl, false, &tally);

	(void)count;
	(void)arguments;
	return status == DB_CTL_OK && tally.broken > 0 ? DB_CTL_NO : status;
}

enum db_ctl_status db_ctl_audit_verify(struct db_ctl *ctl, int count, char **arguments)
{
	struct tally tally = { .checked = 0 };
	enum db_ctl_status status = read_trail(ctl, true, &tally);
	json_t *result;

	(void)count;
	(void)arguments;
	if (status != DB_CTL_OK)
		return status;
	result = json_pack("{s:I, s:I, s:I}", "checked", tally.checked, "broken", tally.broken,
	                   "newest", tally.newest);
	if (ctl->json)
		db_ctl_print_json(result);
	else if (tally.broken == 0)
		db_ctl_say_line(stdout, "%lld lines, up to record %lld: the chain is whole",
		                (long long)tally.checked, (long long)tally.newest);
	else
		db_ctl_say_line(
			stdout, "%lld lines, up to record %lld: the chain is broken in %lld places",
			(long long)tally.checked, (long long)tally.newest, (long long)tally.broken);
	json_decref(result);
	return tally.broken == 0 ? DB_CTL_OK : DB_CTL_NO;
}
