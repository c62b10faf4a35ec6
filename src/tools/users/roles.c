/* SPDX-License-Identifier: Apache-2.0 */
#include "users/roles.h"

#include <stdio.h>
#include <string.h>

/* The lowest role that may; an administrator stands aside. */
static const struct {
	const char *name;
	enum db_role role;
} mays[DB_MAYS] = {
	[DB_MAY_NOTHING] = { "", DB_ROLE_NONE },
	[DB_MAY_LOOK] = { "look", DB_ROLE_OBSERVER },
	[DB_MAY_STOP] = { "stop", DB_ROLE_OPERATOR },
	[DB_MAY_MOVE] = { "move", DB_ROLE_OPERATOR },
	[DB_MAY_ENGINEER] = { "engineer", DB_ROLE_ENGINEER },
	[DB_MAY_MANAGE] = { "manage", DB_ROLE_ENGINEER },
	[DB_MAY_APPOINT] = { "appoint", DB_ROLE_ADMINISTRATOR },
	[DB_MAY_AUDIT] = { "audit", DB_ROLE_ENGINEER },
};

const char *db_role_name(enum db_role role)
{
	static const char *const names[DB_ROLES] = { "none", "observer", "administrator",
		                                     "operator", "engineer" };

	return names[role];
}

bool db_role_read(const char *word, enum db_role *role)
{
	if (strcmp(word, "reader") == 0) {
		*role = DB_ROLE_OBSERVER;
		return true;
	}
	for (enum db_role one = DB_ROLE_OBSERVER; one < DB_ROLES; one++) {
		if (strcmp(word, db_role_name(one)) == 0) {
			*role = one;
			return true;
		}
	}
	return false;
}

const char *db_may_name(enum db_may may)
{
	return mays[may].name;
}

bool db_role_moves(enum db_role role)
{
	return role >= DB_ROLE_OPERATOR;
}

bool db_drives_are_good(const char *drives)
{
	size_t length = strlen(drives);

	if (strcmp(drives, "*") == 0)
		return true;
	for (size_t i = 0; i < length; i++) {
		if (drives[i] <= ' ' || drives[i] > '~' || strchr(":*", drives[i]))
			return false;
	}
	return length > 0 && length <= DB_USERS_DRIVES_MAX && drives[0] != ',' &&
	       drives[length - 1] != ',' && !strstr(drives, ",,");
}

bool db_grant_has_all(const struct db_grant *grant)
{
	return strcmp(grant->drives, "*") == 0;
}

bool db_grant_has_drive(const struct db_grant *grant, const char *drive)
{
	size_t length = strlen(drive);

	if (db_grant_has_all(grant))
		return true;
	for (const char *at = grant->drives; *at;) {
		size_t word = strcspn(at, ",");

		if (word == length && strncmp(at, drive, word) == 0)
			return true;
		at += word + (at[word] == ',');
	}
	return false;
}

static bool has_role(const struct db_grant *grant, enum db_may may)
{
	if (may == DB_MAY_STOP && grant->stops && grant->role != DB_ROLE_NONE)
		return true;
	if (grant->role == DB_ROLE_ADMINISTRATOR && may == DB_MAY_AUDIT)
		return true;
	if (may == DB_MAY_APPOINT)
		return grant->role == DB_ROLE_ADMINISTRATOR;
	return grant->role >= mays[may].role;
}

bool db_grant_has(const struct db_grant *grant, enum db_may may, const char *drive)
{
	if (!has_role(grant, may))
		return false;
	if (may == DB_MAY_MANAGE)
		return db_grant_has_all(grant);
	return (may != DB_MAY_MOVE && may != DB_MAY_ENGINEER && may != DB_MAY_AUDIT) || !drive ||
	       db_grant_has_drive(grant, drive);
}

void db_grant_explain(const struct db_grant *grant, enum db_may may, const char *drive, char *text,
                      size_t size)
{
	if (may == DB_MAY_STOP)
		snprintf(text, size, "%s",
		         "an observer stops drives only where readers-may-stop allows it");
	else if (!has_role(grant, may))
		snprintf(text, size, "this needs the role %s%s", db_role_name(mays[may].role),
		         may == DB_MAY_AUDIT ? " or administrator" : "");
	else if (drive && drive[0] != '\0')
		snprintf(text, size, "%s is not among this user's drives: %s", drive,
		         grant->drives);
	else
		snprintf(text, size, "this needs all drives; this user has %s", grant->drives);
}

/* --- what is done ----------------------------------------------------------------------------- */

const char *const *db_may_commands(enum db_may may)
{
	static const char *const none[] = { NULL };
	/* disable is none of these: a load may fall. */
	static const char *const stops[] = { "stop", "quick_stop", NULL };
	/* What changes the drive for longer than a motion, or its limits' meaning. */
	static const char *const engineers[] = { "save_parameters", "set_position", "raw_frame",
		                                 NULL };
	/* What may be heard by other drives of the bus. */
	static const char *const others[] = { "sync_start", "raw_frame", NULL };

	return may == DB_MAY_STOP     ? stops :
	       may == DB_MAY_ENGINEER ? engineers :
	       may == DB_MAY_MANAGE   ? others :
	                                none;
}

static bool is_among(const char *name, const char *const *names)
{
	while (*names && strcmp(name, *names) != 0)
		names++;
	return *names;
}

enum db_may db_may_of_command(const char *command, const char **drive)
{
	if (is_among(command, db_may_commands(DB_MAY_STOP)))
		return DB_MAY_STOP;
	if (is_among(command, db_may_commands(DB_MAY_MANAGE)))
		*drive = "";
	return is_among(command, db_may_commands(DB_MAY_ENGINEER)) ? DB_MAY_ENGINEER : DB_MAY_MOVE;
}

enum db_may db_may_of_write(const char *drive, const char *reg, double value)
{
	/* Arguments, which execute nothing, and what keeps control and watchdogs. */
	static const char *const operators[] = {
		"command_id",
		"target_position",
		"target_velocity",
		"target_current",
		"shake_start_position",
		"shake_end_position",
		"shake_frequency",
		"shake_cycles",
		"shake_time",
		"program_number",
		"program_delay",
		"control_request",
		"heartbeat",
		"hold_ms",
		"hold_beat",
		NULL,
	};
	static const char units[] = "group_units";
	static const char output[] = "output_";

	if (drive[0] == '\0' &&
	    (strcmp(reg, "group_stop") == 0 || strcmp(reg, "group_stop_units") == 0))
		return value == 1.0 || value == 2.0 ? DB_MAY_STOP : DB_MAY_MOVE;
	if (drive[0] == '\0' && strncmp(reg, units, sizeof(units) - 1) == 0)
		return DB_MAY_STOP;
	if (drive[0] == '\0' && strcmp(reg, "group_start") == 0)
		return DB_MAY_MOVE;
	/* Which command a code is stands elsewhere: one of them may move other drives, too. */
	if (strcmp(reg, "command") == 0 || strcmp(reg, "staged_command") == 0)
		return DB_MAY_MANAGE;
	/* output_number and the like, and each output by itself. */
	if (strncmp(reg, output, sizeof(output) - 1) == 0)
		return DB_MAY_MOVE;
	return is_among(reg, operators) ? DB_MAY_MOVE : DB_MAY_ENGINEER;
}
