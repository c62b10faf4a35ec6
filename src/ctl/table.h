/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands and options of drivebridgectl: the help, the shells' completion, the manual page and what is accepted
 * come from here.
 */
#ifndef DRIVEBRIDGE_CTL_TABLE_H
#define DRIVEBRIDGE_CTL_TABLE_H

#include "ctl/commands.h"

struct db_ctl_option {
	const char *name;
	const char *value;    /* what stands behind it, NULL for a switch */
	const char *commands; /* whose it is, with spaces around each; NULL: of all */
	const char *description;
};

struct db_ctl_command {
	const char *name;      /* one word, or two with a space between */
	const char *arguments; /* as the help shows them */
	/*
	 * What each is, for completion: kinds of `drivebridgectl names` (drives, buses, registers, writable, commands,
	 * arguments), files or drives-or-files, with spaces between; the last one is repeated.
	 */
	const char *kinds;
	int min; /* arguments */
	int max; /* -1: any number */
	bool connects;
	const char *description; /* NULL: not for people */
	db_ctl_function *function;
};

/* Both end with a row without a name. */
extern const struct db_ctl_command db_ctl_commands[];
extern const struct db_ctl_option db_ctl_options[];

/* Whether a command has an option. */
bool db_ctl_takes_option(const struct db_ctl_command *command, const struct db_ctl_option *option);

#endif
