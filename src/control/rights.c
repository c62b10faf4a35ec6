/* SPDX-License-Identifier: Apache-2.0 */
#include "control/rights.h"

#include <grp.h>
#include <pwd.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

#define GROUPS_MAX 256

static bool find_group(const char *name, gid_t *gid)
{
	FILE *file = fopen("/etc/group", "re");
	const struct group *group;
	bool found = false;

	while (file && !found && (group = fgetgrent(file)) != NULL) {
		found = strcmp(group->gr_name, name) == 0;
		if (found)
			*gid = group->gr_gid;
	}
	if (file)
		fclose(file);
	return found;
}

struct db_rights db_rights_of(const struct db_control_config *config)
{
	struct db_rights rights = {
		.everybody_reads = strcmp(config->read_group, DB_EVERYBODY) == 0,
	};

	rights.has_act = find_group(config->act_group, &rights.act);
	rights.has_read = !rights.everybody_reads && find_group(config->read_group, &rights.read);
	return rights;
}

/* Its groups as the kernel has them, the first one included. A process in more of them than fit has none. */
static bool is_member(int fd, const struct ucred *peer, gid_t gid)
{
	gid_t groups[GROUPS_MAX];
	socklen_t size = sizeof groups;

	if (peer->gid == gid)
		return true;
	if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size) != 0)
		return false;
	for (size_t i = 0; i < size / sizeof groups[0]; i++) {
		if (groups[i] == gid)
			return true;
	}
	return false;
}

enum db_right db_rights_find(const struct db_rights *rights, int fd, uid_t *user)
{
	struct ucred peer;
	socklen_t size = sizeof peer;

	*user = (uid_t)-1;
	if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0)
		return DB_RIGHT_NONE;
	*user = peer.uid;
	if (peer.uid == 0 || (rights->has_act && is_member(fd, &peer, rights->act)))
		return DB_RIGHT_ACT;
	if (rights->everybody_reads || (rights->has_read && is_member(fd, &peer, rights->read)))
		return DB_RIGHT_READ;
	return DB_RIGHT_NONE;
}

void db_rights_name(uid_t user, char name[DB_CLIENT_PROCESS_USER_MAX])
{
	FILE *file = fopen("/etc/passwd", "re");
	const struct passwd *entry;
	bool found = false;

	name[0] = '\0';
	while (file && !found && (entry = fgetpwent(file)) != NULL) {
		found = entry->pw_uid == user;
		if (found && strlen(entry->pw_name) < DB_CLIENT_PROCESS_USER_MAX)
			strcpy(name, entry->pw_name);
	}
	if (file)
		fclose(file);
}
