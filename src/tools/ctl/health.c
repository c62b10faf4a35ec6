/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "ctl/terminal.h"
#include "words/value.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define DAY_US (INT64_C(86400) * 1000000)
#define HOUR_S 3600
#define QUARTER_S 900
#define MINUTE_S 60
/* Characters of a chart. */
#define CHART_HEIGHT 5
#define CHART_WIDTH_MAX 240

/* --- table ------------------------------------------------------------------------------------ */

static void add_trip(struct db_ctl_grid *grid, json_int_t us)
{
	if (us == 0)
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.2f ms", (double)us / 1000.0);
}

static void add_row(struct db_ctl_grid *grid, const char *first, const json_t *value)
{
	json_int_t offline = db_words_number(value, "offline_ms");
	json_int_t exchanges = db_words_number(value, "exchanges");
	json_int_t losses = db_words_number(value, "losses");
	const json_t *hottest = json_object_get(value, "hottest");
	json_int_t coldest = db_words_number(value, "coldest");

	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", first);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld", (long long)exchanges);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld", (long long)db_words_number(value, "retries"));
	if (losses == 0)
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "0");
	else
		db_ctl_grid_add(grid, DB_CTL_YELLOW, "%lld (%.2g %%)", (long long)losses,
		                exchanges > 0 ? 100.0 * (double)losses / (double)exchanges : 0.0);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld", (long long)db_words_number(value, "damaged"));
	add_trip(grid, db_words_number(value, "round_trip_us"));
	add_trip(grid, db_words_number(value, "round_trip_longest_us"));
	if (offline == 0)
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "0");
	else
		db_ctl_grid_add(grid, DB_CTL_YELLOW, "%.1f s", (double)offline / 1000.0);
	if (!json_is_integer(hottest))
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "-");
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, db_ctl_say("%lld to %lld"), (long long)coldest,
		                (long long)json_integer_value(hottest));
}

/* In each line when it was, or which drive it is. */
static void print_table(const struct db_ctl *ctl, const json_t *answer, bool of_drive)
{
	static const char *const lists[] = { "values", "running" };
	static const char *const heads[] = { DB_CTL_TEXT("EXCHANGES"), DB_CTL_TEXT("RETRIES"),
		                             DB_CTL_TEXT("LOST"),      DB_CTL_TEXT("DAMAGED"),
		                             DB_CTL_TEXT("MEAN"),      DB_CTL_TEXT("LONGEST"),
		                             DB_CTL_TEXT("OFFLINE"),   DB_CTL_TEXT("DEGREES C") };
	const char *first = of_drive ? DB_CTL_TEXT("UNTIL") : DB_CTL_TEXT("DRIVE");
	struct db_ctl_grid *grid = db_ctl_grid_new("lrrrrrrrr");
	const json_t *value;
	size_t i;

	if (!grid)
		return;
	db_ctl_grid_add_heads(grid, &first, 1);
	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
	/* Of all drives, the minute that goes on is only shown where there is nothing else. */
	for (size_t list = 0; list < 2; list++) {
		const json_t *values = json_object_get(answer, lists[list]);

		if (list == 1 && !of_drive &&
		    json_array_size(json_object_get(answer, "values")) > 0)
			continue;
		json_array_foreach(values, i, value)
		{
			char when[DB_WORDS_TIME_MAX];

			db_words_write_time(db_words_number(value, "end_us"), when);
			when[strcspn(when, ".")] = '\0';
			add_row(grid, of_drive ? when : db_words_text(value, "drive"), value);
		}
	}
	db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

/* --- charts ----------------------------------------------------------------------------------- */

/* A bar for each span of time, as high as the greatest value in it. */
struct chart {
	double bars[CHART_WIDTH_MAX];
	unsigned width;
	double greatest;
};

/* Over the time from the first to the last value, of which some may be missing. */
static void fill_chart(struct chart *chart, const json_t *values, const char *key, unsigned width)
{
	size_t count = json_array_size(values);
	json_int_t first = db_words_number(json_array_get(values, 0), "end_us");
	json_int_t last = db_words_number(json_array_get(values, count - 1), "end_us");
	json_int_t span = last > first ? last - first : 1;
	const json_t *value;
	size_t i;

	*chart = (struct chart){ .width = width < CHART_WIDTH_MAX ? width : CHART_WIDTH_MAX };
	json_array_foreach(values, i, value)
	{
		double at = (double)(db_words_number(value, "end_us") - first) / (double)span;
		unsigned place = at > 0 ? (unsigned)(at * (chart->width - 1)) : 0;
		double number = (double)db_words_number(value, key);

		/* A clock that was set back. */
		if (place >= chart->width)
			place = chart->width - 1;
		if (number > chart->bars[place])
			chart->bars[place] = number;
		if (number > chart->greatest)
			chart->greatest = number;
	}
}

static void print_chart(const struct chart *chart, const char *title, double scale)
{
	putchar('\n');
	db_ctl_say_line(stdout, "%s, at most %.6g", db_ctl_say(title), chart->greatest * scale);
	for (unsigned line = CHART_HEIGHT; line > 0; line--) {
		char text[CHART_WIDTH_MAX + 1];

		for (unsigned i = 0; i < chart->width; i++) {
			double height = chart->bars[i] * CHART_HEIGHT / chart->greatest;

			text[i] = height > line - 1 ? '#' : ' ';
		}
		text[chart->width] = '\0';
		printf("|%s\n", text);
	}
}

static void print_charts(const json_t *values)
{
	static const struct {
		const char *key;
		const char *title;
		double scale;
	} charts[] = {
		{ "losses", DB_CTL_TEXT("lost answers"), 1 },
		{ "retries", DB_CTL_TEXT("questions asked again"), 1 },
		{ "round_trip_longest_us", DB_CTL_TEXT("longest round trip, ms"), 0.001 },
		{ "offline_ms", DB_CTL_TEXT("offline, s"), 0.001 },
		{ "hottest", DB_CTL_TEXT("temperature, degrees C"), 1 },
	};
	size_t count = json_array_size(values);
	char begin[DB_WORDS_TIME_MAX];
	char end[DB_WORDS_TIME_MAX];
	unsigned lines = 24;
	unsigned width = 80;
	struct chart chart = { .width = 0 };
	bool any = false;

	if (count < 2)
		return;
	db_ctl_terminal_size(&lines, &width);
	for (size_t i = 0; i < sizeof(charts) / sizeof(charts[0]); i++) {
		fill_chart(&chart, values, charts[i].key, width > 22 ? width - 1 : 21);
		if (chart.greatest <= 0)
			continue;
		print_chart(&chart, charts[i].title, charts[i].scale);
		any = true;
	}
	if (!any)
		return;
	db_words_write_time(db_words_number(json_array_get(values, 0), "end_us"), begin);
	db_words_write_time(db_words_number(json_array_get(values, count - 1), "end_us"), end);
	printf("%.16s%*.16s\n", begin, (int)chart.width + 1 - 16, end);
}

/* --- the command ------------------------------------------------------------------------------ */

static json_t *ask(struct db_ctl *ctl, const char *drive, json_int_t since_us, int step_s,
                   enum db_ctl_status *status)
{
	json_t *query = json_pack("{s:I, s:i}", "since_us", since_us, "step_s", step_s);

	if (drive)
		(void)json_object_set_new(query, "drive", json_string(drive));
	return db_ctl_call(ctl, "Health", query, DB_CTL_TIMEOUT_MS, status);
}

enum db_ctl_status db_ctl_health(struct db_ctl *ctl, int count, char **arguments)
{
	const char *drive = count > 0 ? arguments[0] : NULL;
	json_int_t now = (json_int_t)time(NULL) * 1000000;
	json_int_t since_us = now - DAY_US;
	enum db_ctl_status status = db_ctl_read_since(ctl, &since_us);
	json_int_t hours = (now - since_us) / (INT64_C(3600) * 1000000);
	const char *trouble;
	json_t *answer;

	if (status != DB_CTL_OK)
		return status;
	/* Some 25 to 170 lines. */
	answer = ask(ctl, drive, since_us,
	             !drive      ? 0 :
	             hours >= 12 ? HOUR_S :
	             hours >= 2  ? QUARTER_S :
	                           MINUTE_S,
	             &status);
	if (status == DB_CTL_OK && ctl->json) {
		db_ctl_print_json(answer);
	} else if (status == DB_CTL_OK) {
		print_table(ctl, answer, drive != NULL);
		if (drive) {
			json_t *fine = ask(ctl, drive, since_us, 0, &status);

			print_charts(json_object_get(fine, "values"));
			json_decref(fine);
		}
		trouble = db_words_text(answer, "trouble");
		if (json_is_false(json_object_get(answer, "on")))
			db_ctl_say_line(
				stdout,
				"health = off: no values are taken, see drivebridge.conf(5)");
		else if (trouble[0])
			db_ctl_say_line(stdout,
			                "the values cannot be written: %s; a restart loses them",
			                trouble);
		else if (json_is_false(json_object_get(answer, "kept")))
			db_ctl_say_line(stdout,
			                "the service has no folder for its state: a restart loses "
			                "the values");
	}
	json_decref(answer);
	return status;
}
