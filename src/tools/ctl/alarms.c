/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* --- reading ---------------------------------------------------------------------------------- */

static int compare_ids(const void *a, const void *b)
{
	const json_t *const *one = a;
	const json_t *const *other = b;
	json_int_t first = db_words_number(*one, "id");
	json_int_t second = db_words_number(*other, "id");

	return first < second ? -1 : first > second;
}

/* All alarms, an array in the order of their ids; *state: the last answer without them. Null: the
 * reason is printed. */
static json_t *read_alarms(struct db_ctl *ctl, json_t **state, enum db_ctl_status *status)
{
	json_t *sorted = json_array();
	json_t *by_id = json_object();
	json_int_t after = 0;
	bool over = false;
	const json_t **list;
	const char *key;
	json_t *alarm;
	size_t count = 0;
	size_t i;

	*state = NULL;
	while (*status == DB_CTL_OK && !over) {
		json_t *answer = db_ctl_call(ctl, "Alarms", json_pack("{s:I}", "after", after),
		                             DB_CTL_TIMEOUT_MS, status);

		/* One that changes meanwhile comes again. */
		json_array_foreach(json_object_get(answer, "alarms"), i, alarm)
		{
			char id[24];

			snprintf(id, sizeof(id), "%lld", (long long)db_words_number(alarm, "id"));
			(void)json_object_set(by_id, id, alarm);
		}
		after = db_words_number(answer, "change");
		over = json_is_true(json_object_get(answer, "over"));
		json_decref(*state);
		*state = answer;
	}
	list = calloc(json_object_size(by_id) + 1, sizeof(*list));
	json_object_foreach(by_id, key, alarm)
	{
		if (list)
			list[count++] = alarm;
	}
	if (list)
		qsort(list, count, sizeof(*list), compare_ids);
	for (i = 0; i < count; i++)
		(void)json_array_append(sorted, (json_t *)(uintptr_t)list[i]);
	free(list);
	json_decref(by_id);
	return sorted;
}

/* --- the list --------------------------------------------------------------------------------- */

static void add_time(struct db_ctl_grid *grid, json_int_t us)
{
	char when[DB_WORDS_TIME_MAX];

	db_words_write_time(us, when);
	when[strcspn(when, ".")] = '\0';
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", when);
}

static void add_row(struct db_ctl_grid *grid, const json_t *alarm)
{
	bool present = json_is_true(json_object_get(alarm, "present"));
	const char *name = db_words_text(alarm, "name");
	char what[512];
	char room[DB_WORDS_TEXT_MAX];
	char when[DB_WORDS_TIME_MAX];
	char by[256];

	snprintf(what, sizeof(what), "%s%s%s", db_ctl_say_name(db_words_text(alarm, "cause")),
	         db_words_text(alarm, "detail")[0] ? ": " : "",
	         db_ctl_translate(db_words_text(alarm, "detail"), room));
	db_words_clean(what);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld", (long long)db_words_number(alarm, "id"));
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", name[0] ? name : db_words_text(alarm, "kind"));
	db_ctl_grid_add(grid, present ? DB_CTL_RED : DB_CTL_PLAIN, "%s", what);
	add_time(grid, db_words_number(alarm, "since_us"));
	if (present)
		db_ctl_grid_add(grid, DB_CTL_RED, "%s", db_ctl_say("is there"));
	else
		add_time(grid, db_words_number(alarm, "gone_us"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld", (long long)db_words_number(alarm, "times"));
	if (db_words_number(alarm, "acknowledged_us") == 0) {
		db_ctl_grid_add(grid, DB_CTL_YELLOW, "%s", db_ctl_say("no"));
		return;
	}
	db_words_write_time(db_words_number(alarm, "acknowledged_us"), when);
	when[strcspn(when, ".")] = '\0';
	snprintf(by, sizeof(by), "%s", db_words_text(alarm, "acknowledged_by"));
	db_words_clean(by);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s, %s", when, by);
}

static void print_alarms(const struct db_ctl *ctl, const json_t *alarms)
{
	static const char *const heads[] = { DB_CTL_TEXT("ID"),          DB_CTL_TEXT("WHERE"),
		                             DB_CTL_TEXT("WHAT"),        DB_CTL_TEXT("SINCE"),
		                             DB_CTL_TEXT("GONE"),        DB_CTL_TEXT("TIMES"),
		                             DB_CTL_TEXT("ACKNOWLEDGED") };
	struct db_ctl_grid *grid = db_ctl_grid_new("rllllrl");
	const json_t *alarm;
	size_t i;

	if (!grid)
		return;
	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
	json_array_foreach(alarms, i, alarm) add_row(grid, alarm);
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

enum db_ctl_status db_ctl_alarms(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status = DB_CTL_OK;
	json_t *state;
	json_t *alarms = read_alarms(ctl, &state, &status);
	const char *trouble;
	const json_t *alarm;
	size_t i;

	(void)count;
	(void)arguments;
	if (status == DB_CTL_OK && ctl->json) {
		json_array_foreach(alarms, i, alarm) db_ctl_print_json(alarm);
	} else if (status == DB_CTL_OK) {
		if (json_array_size(alarms) > 0)
			print_alarms(ctl, alarms);
		else
			db_ctl_say_line(stdout, "no alarms");
		trouble = db_words_text(state, "trouble");
		if (json_is_false(json_object_get(state, "on")))
			db_ctl_say_line(
				stdout,
				"health = off: alarms are not kept, see drivebridge.conf(5)");
		else if (trouble[0])
			db_ctl_say_line(stdout,
			                "the alarms cannot be written: %s; a restart loses them",
			                trouble);
		else if (json_is_false(json_object_get(state, "kept")))
			db_ctl_say_line(stdout,
			                "the service has no folder for its state: a restart loses "
			                "the alarms");
	}
	json_decref(state);
	json_decref(alarms);
	return status;
}

/* --- acknowledging ---------------------------------------------------------------------------- */

static enum db_ctl_status acknowledge(struct db_ctl *ctl, json_int_t id)
{
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer = db_ctl_call(ctl, "AcknowledgeAlarm", json_pack("{s:I}", "id", id),
	                             DB_CTL_TIMEOUT_MS, &status);
	const json_t *alarm = json_object_get(answer, "alarm");
	const char *name = db_words_text(alarm, "name");

	if (status == DB_CTL_OK && ctl->json)
		db_ctl_print_json(alarm);
	else if (status == DB_CTL_OK)
		db_ctl_say_line(stdout, "alarm %lld, %s of %s, is acknowledged", (long long)id,
		                db_ctl_say_name(db_words_text(alarm, "cause")),
		                name[0] ? name : db_words_text(alarm, "kind"));
	json_decref(answer);
	return status;
}

static enum db_ctl_status acknowledge_all(struct db_ctl *ctl)
{
	enum db_ctl_status status = DB_CTL_OK;
	json_t *state;
	json_t *alarms = read_alarms(ctl, &state, &status);
	const json_t *alarm;
	size_t i;

	json_array_foreach(alarms, i, alarm)
	{
		if (status == DB_CTL_OK && db_words_number(alarm, "acknowledged_us") == 0)
			status = acknowledge(ctl, db_words_number(alarm, "id"));
	}
	json_decref(state);
	json_decref(alarms);
	return status;
}

enum db_ctl_status db_ctl_alarms_acknowledge(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status = DB_CTL_OK;

	/* Nothing is acknowledged when one of them is no number. */
	for (int i = 0; i < count; i++) {
		char *end;

		if (count == 1 && strcmp(arguments[0], "all") == 0)
			return acknowledge_all(ctl);
		if (strtoll(arguments[i], &end, 10) <= 0 || *end != '\0')
			return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			                       "%s is no alarm: give the numbers that "
			                       "drivebridgectl alarms shows, or all",
			                       arguments[i]);
	}
	for (int i = 0; i < count && status == DB_CTL_OK; i++)
		status = acknowledge(ctl, strtoll(arguments[i], NULL, 10));
	return status;
}
