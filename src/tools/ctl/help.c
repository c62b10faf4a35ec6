/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/lookup.h"
#include "ctl/say.h"

#include <string.h>

#define INDENT 8
/* Where the words about a command begin in the list of all. */
#define COLUMN 36

static void print_usage(FILE *out, const struct db_ctl_command *command)
{
	(void)fprintf(out, "%s%s%s\n", command->name, command->arguments[0] ? " " : "",
	              command->arguments);
}

static void print_option(FILE *out, const struct db_ctl_option *option)
{
	(void)fprintf(out, "  --%s%s%s\n", option->name, option->value ? " " : "",
	              option->value ? option->value : "");
	db_ctl_wrap(out, DB_CTL_WIDTH, INDENT, INDENT, db_ctl_say(option->description));
}

/* The length of what is before the first semicolon, also one of Chinese. */
static size_t find_end(const char *description)
{
	const char *wide = strstr(description, "；");
	size_t length = strcspn(description, ";");

	return wide && (size_t)(wide - description) < length ? (size_t)(wide - description) :
	                                                       length;
}

/* One line: the beginning of the description. */
static void print_in_short(FILE *out, const struct db_ctl_command *command)
{
	const char *description = db_ctl_say(command->description);
	char usage[64];

	(void)snprintf(usage, sizeof(usage), "%s%s%s", command->name,
	               command->arguments[0] ? " " : "", command->arguments);
	(void)fprintf(out, "  %-*s%.*s\n", COLUMN - 2, usage, (int)find_end(description),
	              description);
}

void db_ctl_print_help(FILE *out)
{
	int task = -1;

	(void)fprintf(out, "%s\n",
	              db_ctl_say("usage: drivebridgectl [OPTIONS] COMMAND [ARGUMENTS]"));
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (!command->description)
			continue;
		if ((int)command->task != task) {
			task = (int)command->task;
			(void)fputs("\n", out);
			(void)fprintf(out, db_ctl_say("%s, such as: drivebridgectl %s"),
			              db_ctl_say(db_ctl_tasks[task].title),
			              db_ctl_tasks[task].example);
			(void)fputs("\n\n", out);
		}
		print_in_short(out, command);
	}
	(void)fprintf(out, "\n%s\n\n",
	              db_ctl_say("drivebridgectl help COMMAND has all about one, and its options. "
	                         "Options of all:"));
	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		if (!option->commands)
			print_option(out, option);
	}
}

static void print_help_of(FILE *out, const struct db_ctl_command *command)
{
	(void)fprintf(out, "%s drivebridgectl ", db_ctl_say("usage:"));
	print_usage(out, command);
	(void)fputs("\n", out);
	db_ctl_wrap(out, DB_CTL_WIDTH, 0, 0, db_ctl_say(command->description));
	(void)fputs("\n", out);
	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		if (!option->commands || !db_ctl_takes_option(command, option))
			continue;
		print_option(out, option);
	}
}

enum db_ctl_status db_ctl_help(struct db_ctl *ctl, int count, char **arguments)
{
	const struct db_ctl_command *command = NULL;
	int taken;

	if (count == 0) {
		db_ctl_print_help(stdout);
		return DB_CTL_OK;
	}
	command = db_ctl_find_command(ctl, count, arguments, &taken);
	if (!command || !command->description)
		return DB_CTL_USAGE;
	print_help_of(stdout, command);
	return DB_CTL_OK;
}
