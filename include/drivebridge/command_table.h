/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The command table: the commands, their names, and the registers of the command block that are
 * their arguments. Constant data and pure functions; any thread.
 */
#ifndef DRIVEBRIDGE_COMMAND_TABLE_H
#define DRIVEBRIDGE_COMMAND_TABLE_H

#include "drivebridge/command.h"
#include "drivebridge/value.h"

#define DB_COMMAND_ARGS_MAX 4 /* several registers of one value count as one */

/* The members of struct db_args, in the order of their registers. */
enum db_arg {
	DB_ARG_NONE,
	DB_ARG_TARGET_POSITION,
	DB_ARG_TARGET_VELOCITY,
	DB_ARG_OUTPUT_NUMBER,
	DB_ARG_OUTPUT_VALUE,
	DB_ARG_OUTPUT_MASK,
	DB_ARG_OUTPUT_LEVELS,
	DB_ARG_SHAKE_START_POSITION,
	DB_ARG_SHAKE_END_POSITION,
	DB_ARG_SHAKE_FREQUENCY,
	DB_ARG_SHAKE_CYCLES,
	DB_ARG_SHAKE_TIME,
	DB_ARG_TARGET_CURRENT,
	DB_ARG_PROGRAM_NUMBER,
	DB_ARG_PROGRAM_DELAY,
	DB_ARG_RAW_LENGTH,
	DB_ARG_RAW_REQUEST,
	DB_ARG_COUNT
};

struct db_arg_row {
	size_t offset; /* in struct db_args; its register row has the same offset */
	size_t bytes;
	const char *name;  /* its register's; "" of NONE */
	enum db_type type; /* of each word of several */
};

/* By enum db_arg. */
extern const struct db_arg_row db_arg_rows[DB_ARG_COUNT];

struct db_command_row {
	enum db_command code;
	const char *name;
	bool own;                              /* only of some families, by its nature */
	enum db_arg args[DB_COMMAND_ARGS_MAX]; /* up to the first NONE */
	const char *description;               /* one line */
};

/* In the order of their codes. */
extern const struct db_command_row db_command_rows[];
extern const size_t db_command_row_count;

/* Null when there is no such command. */
const struct db_command_row *db_command_find(unsigned code);
const struct db_command_row *db_command_find_name(const char *name);
const char *db_command_name(unsigned code); /* "move_absolute" ...; "none" for 0, "unknown" */

/* True if the arguments that this command uses are the same, bit by bit. */
bool db_command_same_args(unsigned code, const struct db_args *a, const struct db_args *b);

#endif
