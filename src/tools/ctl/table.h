/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands and options of drivebridgectl: the help, the shells' completion, the manual page and
 * the check of the command line use this table.
 */
#ifndef DRIVEBRIDGE_CTL_TABLE_H
#define DRIVEBRIDGE_CTL_TABLE_H

#include "ctl/ctl_private.h"

/* The user's tasks; the commands of the table are in this order. */
enum db_ctl_task {
	DB_CTL_TASK_LOOK,
	DB_CTL_TASK_MOVE,
	DB_CTL_TASK_WHY,
	DB_CTL_TASK_PARAMETERS,
	DB_CTL_TASK_SET_UP,
	DB_CTL_TASK_SERVICE,
	DB_CTL_TASK_COUNT,
};

struct db_ctl_task_text {
	const char *title;
	const char *example; /* after "drivebridgectl " */
};

struct db_ctl_option {
	const char *name;
	const char *value;    /* its value in the help, NULL for a switch */
	const char *commands; /* the commands that have it, with spaces around each; NULL: all */
	const char *description;
};

struct db_ctl_command {
	const char *name;      /* one word, or two with a space between */
	const char *arguments; /* in the form of the help */
	/*
	 * The kind of each argument, for completion: kinds of `drivebridgectl names` (drives,
	 * buses, registers, writable, commands, arguments), words (of drivebridgectl's own), files
	 * or drives-or-files, with spaces between; the last one is repeated.
	 */
	const char *kinds;
	int min;       /* numbers of arguments */
	int max;       /* -1: any number */
	bool connects; /* before it is called; false: it does so itself, or need not */
	enum db_ctl_task task;
	const char *description; /* what is before the first semicolon is one line of the help;
	                            NULL: not shown to people */
	db_ctl_function *function;
};

/* The last two end with a row without a name. */
extern const struct db_ctl_task_text db_ctl_tasks[DB_CTL_TASK_COUNT];
extern const struct db_ctl_command db_ctl_commands[];
extern const struct db_ctl_option db_ctl_options[];

#endif
