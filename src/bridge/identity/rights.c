/* SPDX-License-Identifier: Apache-2.0 */
#include "identity/rights.h"

#include <grp.h>
#include <pwd.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define GROUPS_MAX 256
/* With the zero; Linux has no longer names. */
#define LOGIN_NAME_SIZE 33
#define LINE_SIZE 4096 /* of /etc/passwd */

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
		.own = geteuid(),
	};

	rights.has_act = find_group(config->act_group, &rights.act);
	rights.has_read = !rights.everybody_reads && find_group(config->read_group, &rights.read);
	return rights;
}

/* The process's groups as reported by the kernel, including the first one. A process with more
 * groups than fit counts as having none. */
static bool is_member(int fd, const struct ucred *peer, gid_t gid)
{
	gid_t groups[GROUPS_MAX];
	socklen_t size = sizeof(groups);

	if (peer->gid == gid)
		return true;
	if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size) != 0)
		return false;
	for (size_t i = 0; i < size / sizeof(groups[0]); i++) {
		if (groups[i] == gid)
			return true;
	}
	return false;
}

enum db_right db_rights_find(const struct db_rights *rights, int fd, uid_t *user)
{
	struct ucred peer;
	socklen_t size = sizeof(peer);

	*user = (uid_t)-1;
	if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0)
		return DB_RIGHT_NONE;
	*user = peer.uid;
	if (peer.uid == 0 || peer.uid == rights->own ||
	    (rights->has_act && is_member(fd, &peer, rights->act)))
		return DB_RIGHT_ACT;
	if (rights->everybody_reads || (rights->has_read && is_member(fd, &peer, rights->read)))
		return DB_RIGHT_READ;
	return DB_RIGHT_NONE;
}

/* The user's name and first group. False: /etc/passwd does not have it. */
static bool find_user(uid_t user, char name[LOGIN_NAME_SIZE], gid_t *gid)
{
	FILE *file = fopen("/etc/passwd", "re");
	struct passwd entry;
	struct passwd *got;
	char line[LINE_SIZE];
	bool found = false;

	/* The audit trail's thread asks, too. */
	while (file && !found && fgetpwent_r(file, &entry, line, sizeof(line), &got) == 0) {
		found = entry.pw_uid == user && strlen(entry.pw_name) < LOGIN_NAME_SIZE;
		if (found) {
			strcpy(name, entry.pw_name);
			*gid = entry.pw_gid;
		}
	}
	if (file)
		fclose(file);
	return found;
}

/* True if /etc/group names the user in the group of this number. */
static bool group_has(gid_t gid, const char *name)
{
	FILE *file = fopen("/etc/group", "re");
	const struct group *group;
	bool found = false;

	while (file && !found && (group = fgetgrent(file)) != NULL) {
		for (char *const *member = group->gr_mem; group->gr_gid == gid && *member; member++)
			found = found || strcmp(*member, name) == 0;
	}
	if (file)
		fclose(file);
	return found;
}

enum db_right db_rights_of_user(const struct db_rights *rights, uid_t user)
{
	char name[LOGIN_NAME_SIZE];
	gid_t first;
	bool known;

	if (user == 0 || user == rights->own)
		return DB_RIGHT_ACT;
	known = find_user(user, name, &first);
	if (known && rights->has_act && (first == rights->act || group_has(rights->act, name)))
		return DB_RIGHT_ACT;
	if (rights->everybody_reads ||
	    (known && rights->has_read && (first == rights->read || group_has(rights->read, name))))
		return DB_RIGHT_READ;
	return DB_RIGHT_NONE;
}

void db_rights_name(uid_t user, char name[DB_CLIENT_PROCESS_USER_MAX])
{
	char whole[LOGIN_NAME_SIZE];
	gid_t first;

	name[0] = '\0';
	if (find_user(user, whole, &first) && strlen(whole) < DB_CLIENT_PROCESS_USER_MAX)
		strcpy(name, whole);
}
