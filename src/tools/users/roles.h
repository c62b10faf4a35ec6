/* SPDX-License-Identifier: Apache-2.0 */
/* Roles, and what a user with one may do to which drives. Pure. */
#ifndef DRIVEBRIDGE_USERS_ROLES_H
#define DRIVEBRIDGE_USERS_ROLES_H

#include <stdbool.h>
#include <stddef.h>

#define DB_USERS_NAME_MAX 32
#define DB_USERS_DRIVES_MAX 511 /* bytes of a user's list of drives */

/* In the order of what they may do to drives. */
enum db_role {
	DB_ROLE_NONE,
	DB_ROLE_OBSERVER,
	DB_ROLE_ADMINISTRATOR, /* of users: looks, and makes users; moves nothing */
	DB_ROLE_OPERATOR,
	DB_ROLE_ENGINEER,
	DB_ROLES
};

/* What somebody wants to do. */
enum db_may {
	DB_MAY_NOTHING, /* everybody may */
	DB_MAY_LOOK,
	DB_MAY_STOP,     /* stop and quick_stop, of any drive */
	DB_MAY_MOVE,     /* a drive: all its commands except the engineer's; control of it */
	DB_MAY_ENGINEER, /* a drive: parameters, its origin, frames by hand */
	DB_MAY_MANAGE,   /* what is of no single drive: configuration, scans, addresses */
	DB_MAY_APPOINT,  /* users */
	DB_MAY_AUDIT,    /* reads the audit trail: of a drive, or whole */
	DB_MAYS
};

/* What one user may. */
struct db_grant {
	enum db_role role;
	bool stops; /* also an observer or an administrator may stop */
	/* Names separated by commas, which he may move and engineer, and whose part of the audit
	 * trail he reads; "*": all, and the whole trail. */
	char drives[DB_USERS_DRIVES_MAX + 1];
};

/* "none", "observer", "administrator", "operator", "engineer". */
const char *db_role_name(enum db_role role);

/* Also "reader", as an observer was called. False: it is none of a user. */
bool db_role_read(const char *word, enum db_role *role);

/* "look", "stop", "move", "engineer", "manage", "appoint", "audit"; "" for DB_MAY_NOTHING. */
const char *db_may_name(enum db_may may);

/* True for an operator and an engineer. */
bool db_role_moves(enum db_role role);

/* True if a list is "*", or has 1 or more names of drives and fits. */
bool db_drives_are_good(const char *drives);

/* True if all drives are meant. */
bool db_grant_has_all(const struct db_grant *grant);

/* True if this drive is among his. */
bool db_grant_has_drive(const struct db_grant *grant, const char *drive);

/* `drive`: NULL means any one of his, "" the gateway, which has all drives. */
bool db_grant_has(const struct db_grant *grant, enum db_may may, const char *drive);

/* Why he may not, as a sentence without its end: "this needs the role engineer". */
void db_grant_explain(const struct db_grant *grant, enum db_may may, const char *drive, char *text,
                      size_t size);

/* What a command needs, and, for `*drive`, of which drive: one that makes other drives move, too,
 * needs all. */
enum db_may db_may_of_command(const char *command, const char **drive);

/* The commands that need this right, or for DB_MAY_MANAGE all drives; ends with NULL. All others
 * need DB_MAY_MOVE. */
const char *const *db_may_commands(enum db_may may);

/* What writing this value to a register needs; `drive` "" is the gateway. The command is not known
 * by its code here: writing that needs an engineer of all drives. */
enum db_may db_may_of_write(const char *drive, const char *reg, double value);

#endif
