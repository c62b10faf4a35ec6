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

/* 1: there is something to be done; 0: there is not; -1: it is not valid. One task at a time, and a
 * user is not added without a role. */
int db_users_count_tasks(const struct db_users_task *task);

/*
 * Carries it out. A password is asked for twice on a terminal, else it is a line of standard input;
 * `least` is how many characters it has. Errors go to standard error; returns the exit status: 2
 * for a name or drives that are not valid.
 */
int db_users_administer(const struct db_users_keeper *keeper, const char *path, unsigned least,
                        const struct db_users_task *task);

#endif
