/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rights of the users of this machine: from the kernel's data of a process, and from the files
 * /etc/passwd and /etc/group, never by a directory service that may be slow. They are the same at
 * the control socket and, for a client on this machine, at the Modbus port. No state.
 */
#ifndef DRIVEBRIDGE_IDENTITY_RIGHTS_H
#define DRIVEBRIDGE_IDENTITY_RIGHTS_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"

#include <stdbool.h>
#include <sys/types.h>

/* The numbers of the configuration's groups. */
struct db_rights {
	bool everybody_reads;
	bool has_act; /* there is such a group; also the next field */
	bool has_read;
	gid_t act;
	gid_t read;
	uid_t own; /* the user that the service runs as: it acts, like root */
};

enum db_right { DB_RIGHT_NONE, DB_RIGHT_READ, DB_RIGHT_ACT };

struct db_rights db_rights_of(const struct db_control_config *config);

/* The rights and the user of the process at the other end of a Unix socket. The name is "" when not
 * known. */
enum db_right db_rights_find(const struct db_rights *rights, int fd, uid_t *user);
/* The same by the user alone, whose groups are those of the two files: groups that only one of its
 * processes has (SupplementaryGroups= of a unit) are not known here. */
enum db_right db_rights_of_user(const struct db_rights *rights, uid_t user);
/* Any thread. */
void db_rights_name(uid_t user, char name[DB_CLIENT_PROCESS_USER_MAX]);

#endif
