/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

static void add_text(struct db_ctl_grid *grid, enum db_ctl_colour colour, const json_t *position,
                     const char *key)
{
	char text[256];

	snprintf(text, sizeof(text), "%s", db_words_text(position, key));
	db_words_clean(text);
	db_ctl_grid_add(grid, colour, "%s", text);
}

static void add_row(struct db_ctl_grid *grid, const json_t *position)
{
	const char *unit = db_words_text(position, "unit");
	const char *flaw = db_words_text(position, "flaw");
	char when[DB_WORDS_TIME_MAX];

	db_words_write_time(json_integer_value(json_object_get(position, "taught_us")), when);
	when[strcspn(when, ".")] = '\0';
	add_text(grid, DB_CTL_BOLD, position, "name");
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.10g%s%s",
	                json_number_value(json_object_get(position, "units")), unit[0] ? " " : "",
	                unit);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld",
	                (long long)json_integer_value(json_object_get(position, "counts")));
	db_ctl_grid_add(grid, flaw[0] ? DB_CTL_YELLOW : DB_CTL_PLAIN, "%s",
	                flaw[0] ? db_ctl_say_name(flaw) : db_ctl_say("good"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", when);
	add_text(grid, DB_CTL_PLAIN, position, "taught_by");
}

static enum db_ctl_status list(struct db_ctl *ctl, const char *drive)
{
	static const char *const heads[] = { DB_CTL_TEXT("NAME"),   DB_CTL_TEXT("POSITION"),
		                             DB_CTL_TEXT("COUNTS"), DB_CTL_TEXT("STATE"),
		                             DB_CTL_TEXT("TAUGHT"), DB_CTL_TEXT("BY") };
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer = db_ctl_call(ctl, "Positions", json_pack("{s:s}", "drive", drive),
	                             DB_CTL_TIMEOUT_MS, &status);
	const json_t *positions = json_object_get(answer, "positions");
	const char *trouble = db_words_text(answer, "trouble");
	struct db_ctl_grid *grid;
	char room[DB_WORDS_TEXT_MAX];
	const json_t *position;
	size_t i;

	if (!answer || ctl->json) {
		json_array_foreach(positions, i, position) db_ctl_print_json(position);
		json_decref(answer);
		return status;
	}
	grid = db_ctl_grid_new("lrrlll");
	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
	json_array_foreach(positions, i, position) add_row(grid, position);
	if (json_array_size(positions) > 0)
		db_ctl_grid_print(grid, ctl->colour, db_ctl_width(stdout), "\n", stdout);
	else
		db_ctl_say_line(stdout, "%s has no named positions", drive);
	db_ctl_grid_free(grid);
	json_array_foreach(positions, i, position)
	{
		const char *advice = db_words_text(position, "advice");

		if (advice[0])
			printf("%s: %s\n", db_words_text(position, "name"),
			       db_ctl_translate(advice, room));
	}
	if (trouble[0])
		printf("%s\n", db_ctl_translate(trouble, room));
	json_decref(answer);
	return status;
}

static enum db_ctl_status teach(struct db_ctl *ctl, const char *drive, const char *name, bool keep)
{
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer = db_ctl_call(
		ctl, "Teach",
		json_pack("{s:s, s:s, s:b}", "drive", drive, "name", name, "keep", keep),
		DB_CTL_TIMEOUT_MS, &status);
	const json_t *position = json_object_get(answer, "position");
	const char *unit = db_words_text(position, "unit");

	if (answer && ctl->json)
		db_ctl_print_json(position);
	else if (answer)
		db_ctl_say_line(stdout, "%s: %s is at %.10g%s%s", drive, name,
		                json_number_value(json_object_get(position, "units")),
		                unit[0] ? " " : "", unit);
	json_decref(answer);
	return status;
}

static enum db_ctl_status forget(struct db_ctl *ctl, const char *drive, const char *name)
{
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer = db_ctl_call(ctl, "Forget",
	                             json_pack("{s:s, s:s}", "drive", drive, "name", name),
	                             DB_CTL_TIMEOUT_MS, &status);

	if (answer && !ctl->json)
		db_ctl_say_line(stdout, "%s: %s is forgotten", drive, name);
	json_decref(answer);
	return status;
}

enum db_ctl_status db_ctl_position(struct db_ctl *ctl, int count, char **arguments)
{
	const char *drive = arguments[0];
	const char *deed = count == 3 ? arguments[1] : "";
	const char *name = count == 3 ? arguments[2] : "";

	if (!db_ctl_find_drive(ctl, drive))
		return DB_CTL_USAGE;
	if (count == 1)
		return list(ctl, drive);
	if (strcmp(deed, "teach") == 0 || strcmp(deed, "keep") == 0)
		return teach(ctl, drive, name, deed[0] == 'k');
	if (strcmp(deed, "go") == 0)
		return db_ctl_go(ctl, drive, name);
	if (strcmp(deed, "forget") == 0)
		return forget(ctl, drive, name);
	return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
	                       "after %s comes nothing, or teach, go, forget or keep and a name",
	                       drive);
}
