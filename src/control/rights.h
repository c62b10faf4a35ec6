/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who is at the other end of a connection, and what that may: by what the kernel says of the process, and by
 * the files /etc/passwd and /etc/group, never by a directory service that may be slow. No state.
 */
#ifndef DRIVEBRIDGE_CONTROL_RIGHTS_H
#define DRIVEBRIDGE_CONTROL_RIGHTS_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"

#include <stdbool.h>
#include <sys/types.h>

/* The groups of the configuration by their numbers. */
struct db_rights {
	bool everybody_reads;
	bool has_act; /* there is such a group; likewise the next */
	bool has_read;
	gid_t act;
	gid_t read;
};

enum db_right { DB_RIGHT_NONE, DB_RIGHT_READ, DB_RIGHT_ACT };

struct db_rights db_rights_of(const struct db_control_config *config);

/* What the process behind a connected Unix socket may do, and whose it is. The name is "" when not known. */
enum db_right db_rights_find(const struct db_rights *rights, int fd, uid_t *user);
void db_rights_name(uid_t user, char name[DB_CLIENT_PROCESS_USER_MAX]);

#endif
