/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridgectl: the command line.
 */
#include "ctl/ctl_private.h"
#include "ctl/lookup.h"
#include "ctl/say.h"
#include "drivebridge/version.h"
#include "words/nearest.h"

#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define OPTIONS_MAX 48

/* Stores an option where the commands read it. */
static void keep_option(struct db_ctl *ctl, const char *name, const char *value)
{
	const struct {
		const char *name;
		bool *flag;
	} flags[] = {
		{ "json", &ctl->json },
		{ "all", &ctl->all },
		{ "no-wait", &ctl->no_wait },
		{ "relative", &ctl->relative },
		{ "quick", &ctl->quick },
		{ "disable", &ctl->disable },
		{ "follow", &ctl->follow },
		{ "yes", &ctl->yes },
		{ "save", &ctl->save },
		{ "with-address", &ctl->with_address },
		{ "all-bauds", &ctl->all_speeds },
		{ "past", &ctl->past },
		{ "list", &ctl->list },
		{ "help", &ctl->help },
		{ "refused", &ctl->refused },
		{ "cef", &ctl->cef },
	};
	const struct {
		const char *name;
		const char **value;
	} values[] = {
		{ "socket", &ctl->socket },     { "velocity", &ctl->velocity },
		{ "interval", &ctl->interval }, { "addresses", &ctl->addresses },
		{ "baud", &ctl->speed },        { "kept", &ctl->kept },
		{ "output", &ctl->output },     { "duration", &ctl->duration },
		{ "samples", &ctl->samples },   { "trigger", &ctl->trigger },
		{ "before", &ctl->before },     { "plot", &ctl->plot },
		{ "step", &ctl->step },         { "answers", &ctl->answers },
		{ "state", &ctl->state },       { "for", &ctl->form },
		{ "host", &ctl->host },         { "endpoint", &ctl->endpoint },
		{ "ports", &ctl->ports },       { "drive", &ctl->drive },
		{ "user", &ctl->user },         { "since", &ctl->since },
		{ "folder", &ctl->folder },     { "days", &ctl->days },
	};

	for (size_t i = 0; i < sizeof(flags) / sizeof(flags[0]); i++) {
		if (strcmp(flags[i].name, name) == 0)
			*flags[i].flag = true;
	}
	for (size_t i = 0; i < sizeof(values) / sizeof(values[0]); i++) {
		if (strcmp(values[i].name, name) == 0)
			*values[i].value = value;
	}
}

/* Names that options had before, and those that they have now. */
static const struct {
	const char *before;
	const char *now;
} renamed[] = { { "all-speeds", "all-bauds" }, { "speed", "baud" } };

#define RENAMED_COUNT (int)(sizeof(renamed) / sizeof(renamed[0]))

/* Fills in all names that an option can be given by: those of the table in their order, then the
 * former ones. Returns the number of the first. */
static int list_options(struct option *known)
{
	int count = 0;

	for (; count < OPTIONS_MAX && db_ctl_options[count].name; count++)
		known[count] = (struct option){ .name = db_ctl_options[count].name,
			                        .has_arg = db_ctl_options[count].value ?
			                                           required_argument :
			                                           no_argument };
	for (int i = 0; i < RENAMED_COUNT; i++) {
		for (int at = 0; at < count; at++) {
			if (strcmp(known[at].name, renamed[i].now) != 0)
				continue;
			known[count + i] = known[at];
			known[count + i].name = renamed[i].before;
		}
	}
	return count;
}

/* The place of an option in the table, whatever name it was given by. */
static int place_of(const struct option *known, int count, int at)
{
	for (int place = 0; at >= count && place < count; place++) {
		if (strcmp(known[place].name, renamed[at - count].now) == 0)
			return place;
	}
	return at;
}

/* `word` is no option, or is given without its value or with one that it does not take. */
static enum db_ctl_status complain_option(const struct db_ctl *ctl, const struct option *known,
                                          bool lacks_value, const char *word)
{
	json_t *list = json_array();
	size_t length = strcspn(word, "=");
	bool exists = false;
	char name[128];
	char nearest[256];

	for (; known->name; known++) {
		snprintf(name, sizeof(name), "--%s", known->name);
		exists = exists || (strlen(name) == length && strncmp(name, word, length) == 0);
		(void)json_array_append_new(list, json_pack("{s:s}", "name", name));
	}
	snprintf(name, sizeof(name), "%.*s", (int)length, word);
	db_words_nearest_names(list, name, nearest, sizeof(nearest));
	json_decref(list);
	if (lacks_value)
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "%s needs a value; drivebridgectl help says which", name);
	if (exists)
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "%s takes no value", name);
	return db_ctl_complain(
		ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		"there is no option \"%s\"; drivebridgectl --help says what there is%s", name,
		nearest);
}

/* A negative number is an argument, not an option. */
#define NEGATIVE "-:0::1::2::3::4::5::6::7::8::9::.::"

/*
 * -1 to continue, else the exit status. `given` has an element for each option; the other words are
 * moved to `argv[1]` and after, `count` of them.
 */
static int read_options(struct db_ctl *ctl, int argc, char **argv, bool *given, int *count)
{
	struct option known[OPTIONS_MAX + RENAMED_COUNT + 1] = { { .name = NULL } };
	int known_count = list_options(known);
	int at = 0;
	int found;

	while ((found = getopt_long(argc, argv, NEGATIVE, known, &at)) != -1) {
		if (found == '?' || found == ':')
			return (int)complain_option(ctl, known, found == ':', argv[optind - 1]);
		if (found != 0) {
			argv[++*count] = found == 1 ? optarg : argv[optind - 1];
			continue;
		}
		at = place_of(known, known_count, at);
		given[at] = true;
		if (strcmp(db_ctl_options[at].name, "version") == 0) {
			puts("drivebridgectl " DB_VERSION);
			return DB_CTL_OK;
		}
		keep_option(ctl, db_ctl_options[at].name, optarg);
	}
	while (optind < argc)
		argv[++*count] = argv[optind++];
	return -1;
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
	int count = 0;
	int words = 0;
	int ended;

	db_ctl_open_language();
	ended = read_options(&ctl, argc, argv, given, &count);
	argv++;
	if (ended >= 0)
		return ended;
	if (count == 0 && ctl.help)
		return (int)db_ctl_help(&ctl, 0, argv);
	if (count == 0) {
		db_ctl_print_help(stderr);
		return DB_CTL_USAGE;
	}
	/* A pager that ends early is no error. */
	(void)signal(SIGPIPE, SIG_IGN);
	ctl.colour = isatty(STDOUT_FILENO) && !(no_colour && no_colour[0]);
	command = db_ctl_find_command(&ctl, count, argv, &words);
	if (command && ctl.help)
		return (int)db_ctl_help(&ctl, count, argv);
	if (command) {
		ctl.word = command->name;
		status = check_arguments(&ctl, command, count - words, given);
	}
	if (status == DB_CTL_OK && command->connects)
		status = db_ctl_open(&ctl);
	if (status == DB_CTL_OK)
		status = command->function(&ctl, count - words, argv + words);
	db_ctl_close(&ctl);
	if (fflush(stdout) != 0 && status == DB_CTL_OK)
		status = DB_CTL_NO;
	return (int)status;
}
