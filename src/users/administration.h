/* SPDX-License-Identifier: Apache-2.0 */
/* Makes users and takes them away, for the administrator at a terminal or a script. */
#ifndef DRIVEBRIDGE_USERS_ADMINISTRATION_H
#define DRIVEBRIDGE_USERS_ADMINISTRATION_H

#include "users/users.h"

/*
 * Adds the user `add`, or gives one another password and role, or takes `remove` away; one of both is NULL. The password
 * is asked for twice on a terminal, else it is a line of standard input. What is wrong goes to standard error; the
 * status for exit(): 2 for a name that cannot be one.
 */
int db_users_administer(const struct db_users_keeper *keeper, const char *path, const char *add,
                        const char *remove, enum db_role role);

#endif
