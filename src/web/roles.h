/* SPDX-License-Identifier: Apache-2.0 */
/* Who may do what. Pure. */
#ifndef DRIVEBRIDGE_WEB_ROLES_H
#define DRIVEBRIDGE_WEB_ROLES_H

/* Each may what those before it may. */
enum db_web_role { DB_WEB_NONE, DB_WEB_READER, DB_WEB_OPERATOR };

/* "none", "reader", "operator". */
const char *db_web_role_name(enum db_web_role role);

#define DB_WEB_NAME_MAX 32

#endif
