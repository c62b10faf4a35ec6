/* SPDX-License-Identifier: Apache-2.0 */
/* Roles and their rights. Pure. */
#ifndef DRIVEBRIDGE_USERS_ROLES_H
#define DRIVEBRIDGE_USERS_ROLES_H

/* Each role includes the rights of those before it. */
enum db_role { DB_ROLE_NONE, DB_ROLE_READER, DB_ROLE_OPERATOR };

/* "none", "reader", "operator". */
const char *db_role_name(enum db_role role);

#define DB_USERS_NAME_MAX 32

#endif
