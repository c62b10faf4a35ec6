/* SPDX-License-Identifier: Apache-2.0 */
/* Adds and removes users, for the administrator at a terminal or a script. */
#ifndef DRIVEBRIDGE_USERS_ADMINISTRATION_H
#define DRIVEBRIDGE_USERS_ADMINISTRATION_H

#include "users/users.h"

/* The options of the command line; those not given are NULL. */
struct db_users_task {
	const char *add;
	const char *remove;
	const char *role; /* of the added user */
};

/* True if it is a valid task, or none: a user cannot be added without a role. */
bool db_users_task_is_good(const struct db_users_task *task);

/*
 * Adds a user, changes a user's password and role, or removes one. The password is asked for twice
 * on a terminal, else it is a line of standard input. Errors go to standard error; returns the exit
 * status: 2 for a name that is not valid.
 */
int db_users_administer(const struct db_users_keeper *keeper, const char *path,
                        const struct db_users_task *task);

#endif
