/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/lookup.h"
#include "ctl/say.h"

#include <string.h>

#define INDENT 8
/* Where the words about a command begin in the list of all. */
#define COLUMN 36

static void print_option(FILE *out, const struct db_ctl_option *option)
{
	fprintf(out, "  --%s%s%s\n", option->name, option->value ? " " : "",
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

void db_ctl_print_help(FILE *out)
{
	const char *description;
	char usage[64];
	int task = -1;

	fprintf(out, "%s\n", db_ctl_say("usage: drivebridgectl [OPTIONS] COMMAND [ARGUMENTS]"));
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (!command->description)
			continue;
		if ((int)command->task != task) {
			task = (int)command->task;
			fputs("\n", out);
			fprintf(out, db_ctl_say("%s, such as: drivebridgectl %s"),
			        db_ctl_say(db_ctl_tasks[task].title), db_ctl_tasks[task].example);
			fputs("\n\n", out);
		}
		/* One line: the beginning of the description. */
		description = db_ctl_say(command->description);
		snprintf(usage, sizeof(usage), "%s%s%s", command->name,
		         command->arguments[0] ? " " : "", command->arguments);
		fprintf(out, "  %-*s%.*s\n", COLUMN - 2, usage, (int)find_end(description),
		        description);
	}
	fprintf(out, "\n%s\n\n",
	        db_ctl_say("drivebridgectl help COMMAND has all about one, and its options. "
	                   "Options of all:"));
	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		if (!option->commands)
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
	printf("%s drivebridgectl %s%s%s\n\n", db_ctl_say("usage:"), command->name,
	       command->arguments[0] ? " " : "", command->arguments);
	db_ctl_wrap(stdout, DB_CTL_WIDTH, 0, 0, db_ctl_say(command->description));
	putchar('\n');
	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		if (option->commands && db_ctl_takes_option(command, option))
			print_option(stdout, option);
	}
	return DB_CTL_OK;
}
