/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridgectl: the command line.
 */
#include "ctl/nearest.h"
#include "ctl/table.h"
#include "drivebridge/version.h"

#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define OPTIONS_MAX 32

static void print_usage(FILE *out)
{
	(void)fputs("usage: drivebridgectl [OPTIONS] COMMAND [ARGUMENTS]\n\n", out);
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (command->description)
			(void)fprintf(out, "  %s%s%s\n        %s\n", command->name,
			              command->arguments[0] ? " " : "", command->arguments,
			              command->description);
	}
	(void)fputs("\n", out);
	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		(void)fprintf(out, "  --%s%s%s\n        %s%.*s%s%s\n", option->name,
		              option->value ? " " : "", option->value ? option->value : "",
		              option->commands ? "With" : "",
		              option->commands ? (int)strlen(option->commands) - 1 : 0,
		              option->commands ? option->commands : "",
		              option->commands ? ": " : "", option->description);
	}
}

/* Into what the commands read. */
static void keep_option(struct db_ctl *ctl, const char *name, const char *value)
{
	if (strcmp(name, "socket") == 0)
		ctl->socket = value;
	else if (strcmp(name, "json") == 0)
		ctl->json = true;
	else if (strcmp(name, "all") == 0)
		ctl->all = true;
	else if (strcmp(name, "no-wait") == 0)
		ctl->no_wait = true;
	else if (strcmp(name, "quick") == 0)
		ctl->quick = true;
	else if (strcmp(name, "disable") == 0)
		ctl->disable = true;
	else if (strcmp(name, "velocity") == 0)
		ctl->velocity = value;
	else if (strcmp(name, "interval") == 0)
		ctl->interval = value;
	else if (strcmp(name, "follow") == 0)
		ctl->follow = true;
	else if (strcmp(name, "yes") == 0)
		ctl->yes = true;
	else if (strcmp(name, "save") == 0)
		ctl->save = true;
	else if (strcmp(name, "with-address") == 0)
		ctl->with_address = true;
	else if (strcmp(name, "all-speeds") == 0)
		ctl->all_speeds = true;
	else if (strcmp(name, "addresses") == 0)
		ctl->addresses = value;
	else if (strcmp(name, "speed") == 0)
		ctl->speed = value;
	else if (strcmp(name, "kept") == 0)
		ctl->kept = value;
	else if (strcmp(name, "past") == 0)
		ctl->past = true;
	else if (strcmp(name, "output") == 0)
		ctl->output = value;
	else if (strcmp(name, "duration") == 0)
		ctl->duration = value;
	else if (strcmp(name, "samples") == 0)
		ctl->samples = value;
	else if (strcmp(name, "trigger") == 0)
		ctl->trigger = value;
	else if (strcmp(name, "before") == 0)
		ctl->before = value;
	else if (strcmp(name, "plot") == 0)
		ctl->plot = value;
}

/* -1 to go on, else the status to exit with. `given` has a place for each option. */
static int read_options(struct db_ctl *ctl, int argc, char **argv, bool *given)
{
	struct option known[OPTIONS_MAX + 1] = { { .name = NULL } };
	int at = 0;

	for (int i = 0; i < OPTIONS_MAX && db_ctl_options[i].name; i++)
		known[i] = (struct option){ .name = db_ctl_options[i].name,
			                    .has_arg = db_ctl_options[i].value ? required_argument :
			                                                         no_argument };
	for (;;) {
		int found = getopt_long(argc, argv, "", known, &at);

		if (found == -1)
			return -1;
		if (found != 0) {
			(void)fputs("drivebridgectl --help says what there is\n", stderr);
			return DB_CTL_USAGE;
		}
		given[at] = true;
		if (strcmp(db_ctl_options[at].name, "help") == 0) {
			print_usage(stdout);
			return DB_CTL_OK;
		}
		if (strcmp(db_ctl_options[at].name, "version") == 0) {
			(void)puts("drivebridgectl " DB_VERSION);
			return DB_CTL_OK;
		}
		keep_option(ctl, db_ctl_options[at].name, optarg);
	}
}

/* How many words of the command line are this command's name; 0: they are another. */
static int count_words(const struct db_ctl_command *command, int count, char **words)
{
	size_t first = strcspn(command->name, " ");

	if (strlen(words[0]) != first || strncmp(words[0], command->name, first) != 0)
		return 0;
	if (command->name[first] == '\0')
		return 1;
	return count > 1 && strcmp(words[1], command->name + first + 1) == 0 ? 2 : 0;
}

/* With the number of words that name it. */
static const struct db_ctl_command *find_command(const struct db_ctl *ctl, int count, char **words,
                                                 int *taken)
{
	json_t *list = json_array();
	size_t first = strlen(words[0]);
	char name[128];
	char nearest[256];

	(void)snprintf(name, sizeof(name), "%s", words[0]);
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		*taken = count_words(command, count, words);
		if (*taken > 0) {
			json_decref(list);
			return command;
		}
		if (command->description)
			(void)json_array_append_new(list,
			                            json_pack("{s:s}", "name", command->name));
		if (count > 1 && strncmp(words[0], command->name, first) == 0 &&
		    command->name[first] == ' ')
			(void)snprintf(name, sizeof(name), "%s %s", words[0], words[1]);
	}
	db_ctl_nearest_names(list, name, nearest, sizeof(nearest));
	json_decref(list);
	(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
	                      "there is no command \"%s\"%s", name, nearest);
	return NULL;
}

/* DB_CTL_OK, or the reason is printed. */
static enum db_ctl_status check_arguments(const struct db_ctl *ctl,
                                          const struct db_ctl_command *command, int count,
                                          const bool *given)
{
	for (int i = 0; db_ctl_options[i].name; i++) {
		if (given[i] && !db_ctl_takes_option(command, &db_ctl_options[i]))
			return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
			                       "%s has no option --%s", command->name,
			                       db_ctl_options[i].name);
	}
	if (count < command->min || (command->max >= 0 && count > command->max))
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "usage: drivebridgectl %s%s%s", command->name,
		                       command->arguments[0] ? " " : "", command->arguments);
	return DB_CTL_OK;
}

int main(int argc, char **argv)
{
	const char *no_colour = getenv("NO_COLOR");
	const char *socket = getenv("DRIVEBRIDGE_SOCKET");
	struct db_ctl ctl = { .socket = socket && socket[0] ? socket : DB_CTL_SOCKET };
	bool given[OPTIONS_MAX] = { false };
	const struct db_ctl_command *command;
	enum db_ctl_status status = DB_CTL_USAGE;
	int words = 0;
	int ended = read_options(&ctl, argc, argv, given);

	if (ended >= 0)
		return ended;
	if (optind == argc) {
		print_usage(stderr);
		return DB_CTL_USAGE;
	}
	/* A pager that ends is no accident. */
	(void)signal(SIGPIPE, SIG_IGN);
	ctl.colour = isatty(STDOUT_FILENO) && !(no_colour && no_colour[0]);
	command = find_command(&ctl, argc - optind, argv + optind, &words);
	argc -= optind + words;
	argv += optind + words;
	if (command)
		status = check_arguments(&ctl, command, argc, given);
	if (status == DB_CTL_OK && command->connects)
		status = db_ctl_open(&ctl);
	if (status == DB_CTL_OK)
		status = command->function(&ctl, argc, argv);
	db_ctl_close(&ctl);
	if (fflush(stdout) != 0 && status == DB_CTL_OK)
		status = DB_CTL_NO;
	return (int)status;
}
