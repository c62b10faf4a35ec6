/* SPDX-License-Identifier: Apache-2.0 */
/* Makes users and takes them away, for the administrator at a terminal or a script. */
#ifndef DRIVEBRIDGE_USERS_ADMINISTRATION_H
#define DRIVEBRIDGE_USERS_ADMINISTRATION_H

#include "users/users.h"

/* What is to be done; what is not is NULL. */
struct db_users_task {
	const char *add;
	const char *remove;
	const char *role; /* of who is added */
};

/* Whether that can be done, or there is nothing to do: nobody is added without a role. */
bool db_users_task_is_good(const struct db_users_task *task);

/*
 * Adds a user, or gives one another password and role, or takes one away. The password is asked for twice on a terminal,
 * else it is a line of standard input. What is wrong goes to standard error; the status for exit(): 2 for a name that
 * cannot be one.
 */
int db_users_administer(const struct db_users_keeper *keeper, const char *path,
                        const struct db_users_task *task);

#endif
