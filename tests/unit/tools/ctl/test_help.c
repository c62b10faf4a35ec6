/* SPDX-License-Identifier: Apache-2.0 */
/* What people read fits a terminal, and the examples are commands that there are. */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/lookup.h"
#include "ctl/plant.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static char *text;
static size_t size;

static FILE *open_text(void)
{
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	return out;
}

static void expect_text(FILE *out, const char *expected)
{
	(void)fclose(out);
	assert_string_equal(text, expected);
	free(text);
}

static void test_text_is_broken_between_words(void **state)
{
	FILE *out = open_text();

	(void)state;
	db_ctl_wrap(out, 12, 0, 2, "one two three four");
	expect_text(out, "one two\n  three four\n");
	out = open_text();
	db_ctl_wrap(out, 0, 2, 4, "one two three four");
	expect_text(out, "  one two three four\n");
	out = open_text();
	/* Letters, not bytes; colours take no room; a word that is too long stands alone. */
	db_ctl_wrap(out, 7, 0, 0, "\xc2\xb5\xc2\xb5\xc2\xb5 \033[31mabc\033[0m longlonglong x");
	expect_text(out, "\xc2\xb5\xc2\xb5\xc2\xb5 \033[31mabc\033[0m\nlonglonglong\nx\n");
}

static void test_the_help_fits_and_has_every_command(void **state)
{
	FILE *out = open_text();
	char usage[256];

	(void)state;
	db_ctl_print_help(out);
	(void)fclose(out);
	for (const char *line = text; *line; line += strcspn(line, "\n") + 1)
		assert_in_range(strcspn(line, "\n"), 0, 80);
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		(void)snprintf(usage, sizeof(usage), "\n  %s%s%s ", command->name,
		               command->arguments[0] ? " " : "", command->arguments);
		if (command->description)
			assert_non_null(strstr(text, usage));
		else
			assert_null(strstr(text, usage));
	}
	free(text);
}

static void test_examples_are_commands_of_their_task(void **state)
{
	const struct db_ctl ctl = { .json = false };

	(void)state;
	for (int task = 0; task < DB_CTL_TASK_COUNT; task++) {
		const struct db_ctl_command *command;
		char line[128];
		char *words[16];
		int count = 0;
		int taken = 0;

		(void)snprintf(line, sizeof(line), "%s", db_ctl_tasks[task].example);
		for (char *word = strtok(line, " "); word; word = strtok(NULL, " ")) {
			if (strncmp(word, "--", 2) != 0)
				words[count++] = word;
		}
		command = db_ctl_find_command(&ctl, count, words, &taken);
		assert_non_null(command);
		assert_int_equal((int)command->task, task);
		assert_true(count - taken >= command->min);
		assert_true(command->max < 0 || count - taken <= command->max);
	}
}

static struct db_ctl_grid *make_plant(const char *bus)
{
	struct db_ctl_grid *grid = db_ctl_grid_new(DB_CTL_DRIVE_COLUMNS);
	json_t *drive = json_pack("{s:s, s:s, s:s}", "name", "conveyor", "bus", bus, "unit_name",
	                          "mm");
	json_t *values = json_pack("{s:i, s:f, s:f}", "age_ms", 12, "position_units", -10000.0,
	                           "velocity_units", 1000.0);
	const struct db_ctl_judgement judgement = { .need = DB_CLIENT_ACT, .cause = "watchdog" };

	db_ctl_add_heads(grid);
	db_ctl_add_drive(grid, drive, NULL, values, &judgement);
	json_decref(drive);
	json_decref(values);
	return grid;
}

static void expect_plant(const char *bus, unsigned width, const char *expected)
{
	struct db_ctl_grid *grid = make_plant(bus);
	FILE *out = open_text();

	db_ctl_fit_drives(grid, width);
	db_ctl_grid_print(grid, false, width, "\n", out);
	db_ctl_grid_free(grid);
	expect_text(out, expected);
}

static void test_a_table_leaves_out_what_has_no_room(void **state)
{
	(void)state;
	expect_plant("line", 80,
	             "DRIVE     BUS   STATE      POSITION      VELOCITY    AGE  NEEDS\n"
	             "conveyor  line  -      -10000.00 mm  1000.00 mm/s  12 ms  clear_fault\n");
	expect_plant("the-line-of-hall-number-three-on", 80,
	             "DRIVE     STATE      POSITION      VELOCITY  NEEDS\n"
	             "conveyor  -      -10000.00 mm  1000.00 mm/s  clear_fault\n");
	expect_plant("line", 40,
	             "DRIVE     STATE      POSITION  NEEDS\n"
	             "conveyor  -      -10000.00 mm  clear_fau\n");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_text_is_broken_between_words),
		cmocka_unit_test(test_the_help_fits_and_has_every_command),
		cmocka_unit_test(test_examples_are_commands_of_their_task),
		cmocka_unit_test(test_a_table_leaves_out_what_has_no_room),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
