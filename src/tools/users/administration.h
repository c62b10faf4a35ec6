/* SPDX-License-Identifier: Apache-2.0 */
/* Makes and removes users, for the administrator at a terminal or a script. */
#ifndef DRIVEBRIDGE_USERS_ADMINISTRATION_H
#define DRIVEBRIDGE_USERS_ADMINISTRATION_H

#include "users/users.h"

/* The options of the command line; those not given are NULL or false. */
struct db_users_task {
	const char *add;
	const char *remove;
	const char *role;   /* of the added user */
	const char *drives; /* likewise; NULL: all */
	bool pam;           /* likewise: PAM checks the password */
	bool list;
	bool move; /* the users of the program's file of before into the one of all */
};

/* True if anything is to be done. */
bool db_users_task_is_given(const struct db_users_task *task);

/* True if it is a valid task, or none: one at a time, and a user is not added without a role. */
bool db_users_task_is_good(const struct db_users_task *task);

/*
 * Carries it out. A password is asked for twice on a terminal, else it is a line of standard input;
 * `least` is how many characters it has. Errors go to standard error; returns the exit status: 2
 * for a name or drives that are not valid.
 */
int db_users_administer(const struct db_users_keeper *keeper, const char *path, unsigned least,
                        const struct db_users_task *task);

#endif
