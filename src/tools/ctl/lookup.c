/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/lookup.h"
#include "words/nearest.h"

#include <stdio.h>
#include <string.h>

/* The number of words at the start of the command line that name this command; 0: another
 * command. */
static int count_words(const struct db_ctl_command *command, int count, char **words)
{
	size_t first = strcspn(command->name, " ");

	if (strlen(words[0]) != first || strncmp(words[0], command->name, first) != 0)
		return 0;
	if (command->name[first] == '\0')
		return 1;
	return count > 1 && strcmp(words[1], command->name + first + 1) == 0 ? 2 : 0;
}

const struct db_ctl_command *db_ctl_find_command(const struct db_ctl *ctl, int count, char **words,
                                                 int *taken)
{
	json_t *list = json_array();
	size_t first = strlen(words[0]);
	char name[128];
	char nearest[256];

	snprintf(name, sizeof(name), "%s", words[0]);
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
			snprintf(name, sizeof(name), "%s %s", words[0], words[1]);
	}
	db_words_nearest_names(list, name, nearest, sizeof(nearest));
	json_decref(list);
	(void)db_ctl_complain(
		ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		"there is no command \"%s\"; drivebridgectl help lists them, drivebridgectl run "
		"DRIVE those of a drive%s",
		name, nearest);
	return NULL;
}

bool db_ctl_takes_option(const struct db_ctl_command *command, const struct db_ctl_option *option)
{
	const char *at = option->commands;
	size_t length = strlen(command->name);

	while (at && (at = strstr(at, command->name)) != NULL) {
		if (at[-1] == ' ' && at[length] == ' ')
			return true;
		at += length;
	}
	return !option->commands;
}
