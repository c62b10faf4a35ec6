/* SPDX-License-Identifier: Apache-2.0 */
#include "users/users.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <libgen.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define PATH_MAX_BYTES 512

/* In place of a hash. */
#define PAM "pam"

/* Others change a file in some thousandths of a second: whoever does not come to an end is not
 * waited for longer than 2 s in all. */
#define LOCK_EVERY_MS 20
#define LOCK_TRIES 100

bool db_users_name_is_good(const char *name)
{
	static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
				      "0123456789.-_";
	size_t length = strlen(name);

	return length >= 1 && length <= DB_USERS_NAME_MAX && strspn(name, letters) == length &&
	       !strchr(".-_", name[0]);
}

/* Splits a text at its first colon. NULL: it has none. */
static char *split(char *text)
{
	char *colon = text ? strchr(text, ':') : NULL;

	if (!colon)
		return NULL;
	*colon = '\0';
	return colon + 1;
}

/* NULL: the line is valid, else the mistake. */
static const char *parse_line(char *line, struct db_user *user)
{
	char *role = split(line);
	char *drives = split(role);
	char *hash = split(drives);
	bool old = drives && !hash;
	char all[] = "*";

	if (!drives)
		return "a line is NAME:ROLE:DRIVES:PASSWORD";
	if (old)
		hash = drives;
	*user = (struct db_user){ .pam = !old && strcmp(hash, PAM) == 0 };
	if (!db_users_name_is_good(line))
		return "a name has 1 to 32 letters, digits, '.', '-' and '_'";
	if (old)
		user->grant.role = strcmp(role, "reader") == 0   ? DB_ROLE_OBSERVER :
		                   strcmp(role, "operator") == 0 ? DB_ROLE_ENGINEER :
		                                                   DB_ROLE_NONE;
	if (old && user->grant.role == DB_ROLE_NONE)
		return "in a line of three parts a role is reader or operator";
	if (!old && !db_role_read(role, &user->grant.role))
		return "a role is observer, operator, engineer or administrator";
	if (!old && !db_drives_are_good(drives))
		return "drives are * or names with commas between them";
	if (!user->pam && !db_password_is_hash(hash))
		return "this is no hash of a password; --add-user makes them";
	/* All fit, as checked above. */
	memcpy(user->name, line, strlen(line) + 1);
	if (old)
		drives = all;
	memcpy(user->grant.drives, drives, strlen(drives) + 1);
	if (!user->pam)
		memcpy(user->hash, hash, strlen(hash) + 1);
	return NULL;
}

/* Adds the users of a text; of a file of before those whose names are new. */
static bool add_users(struct db_users *users, const char *text, const char *path, bool former,
                      FILE *out)
{
	size_t known = users->count;
	char line[1024];
	unsigned number = 0;
	bool good = true;

	while (*text) {
		size_t length = strcspn(text, "\n");
		struct db_user *user = &users->list[users->count];
		const struct db_user *same = NULL;
		const char *why = NULL;

		number++;
		if (length >= sizeof(line)) {
			why = "the line is too long";
		} else {
			/* gcc's analyzer forgets that what is behind a file's bytes is zero. */
			memcpy(line, text, length);
			line[length] = '\0';
			/* Neither a comment nor empty. */
			if (line[0] != '#' && line[strspn(line, " \t\r")] != '\0') {
				why = users->count + 1 == DB_USERS_MAX ? "there are too many" :
				                                         parse_line(line, user);
				same = why ? NULL : db_users_find(users, user->name);
				if (same && same >= users->list + known)
					why = "this name stands there already";
				user->former = former;
				users->count += !why && !same;
				users->former += former && !why && !same;
			}
		}
		if (why && out)
			fprintf(out, "%s:%u: %s\n", path, number, why);
		good = good && !why;
		/* gcc's analyzer, likewise */
		text += length + (text[length] == '\n');
	}
	explicit_bzero(line, sizeof(line));
	return good;
}

static bool begin_users(struct db_users *users)
{
	*users = (struct db_users){ .list = calloc(DB_USERS_MAX, sizeof(*users->list)) };
	return users->list;
}

bool db_users_parse(struct db_users *users, const char *text, const char *path, FILE *out)
{
	return begin_users(users) && add_users(users, text, path, false, out);
}

/* The whole text; NULL with errno. A missing file counts as an empty text. */
static char *read_text(const char *path, struct stat *status)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	char *text = NULL;
	ssize_t got = 0;
	size_t used = 0;

	memset(status, 0, sizeof(*status));
	if (fd < 0)
		return errno == ENOENT ? strdup("") : NULL;
	if (fstat(fd, status) == 0 && !S_ISREG(status->st_mode))
		errno = EINVAL;
	else
		text = calloc(1, DB_USERS_FILE_MAX + 1);
	while (text && used < DB_USERS_FILE_MAX &&
	       (got = read(fd, text + used, DB_USERS_FILE_MAX - used)) > 0)
		used += (size_t)got;
	if (text && (got < 0 || used == DB_USERS_FILE_MAX)) {
		errno = got < 0 ? errno : EFBIG;
		free(text);
		text = NULL;
	}
	(void)close(fd);
	return text;
}

void db_users_former(const char *path, const struct db_users_keeper *keeper, char *former,
                     size_t size)
{
	static const char common[] = "/access/users";
	size_t length = strlen(path);
	size_t end = sizeof(common) - 1;

	former[0] = '\0';
	if (keeper->former && length > end && strcmp(path + length - end, common) == 0)
		snprintf(former, size, "%.*s/%s", (int)(length - end), path, keeper->former);
}

static bool load_file(struct db_users *users, const char *path, bool former, FILE *out)
{
	struct stat status;
	char *text = read_text(path, &status);
	bool good = false;

	if (!text) {
		if (out)
			fprintf(out, "%s: %s\n", path, strerror(errno));
	} else if (status.st_mode & (S_IROTH | S_IWOTH)) {
		if (out)
			fprintf(out,
			        "%s: can be read or written by everybody: chmod 0640 %s, and "
			        "chgrp it to the group %s\n",
			        path, path, DB_USERS_GROUP);
	} else {
		good = add_users(users, text, path, former, out);
	}
	if (text)
		explicit_bzero(text, strlen(text));
	free(text);
	return good;
}

bool db_users_load(struct db_users *users, const char *path, const struct db_users_keeper *keeper,
                   FILE *out)
{
	char former[PATH_MAX_BYTES];
	bool good = begin_users(users) && load_file(users, path, false, out);

	db_users_former(path, keeper, former, sizeof(former));
	if (good && former[0] != '\0')
		good = load_file(users, former, true, out);
	return good;
}

void db_users_clear(struct db_users *users)
{
	if (users->list)
		explicit_bzero(users->list, DB_USERS_MAX * sizeof(*users->list));
	free(users->list);
	*users = (struct db_users){ .list = NULL };
}

const struct db_user *db_users_find(const struct db_users *users, const char *name)
{
	for (size_t i = 0; i < users->count; i++) {
		/* A user that is put is there, and so has a name. */
		// NOLINTNEXTLINE(clang-analyzer-core.NonNullParamChecker)
		if (strcmp(users->list[i].name, name) == 0)
			return &users->list[i];
	}
	return NULL;
}

static uint64_t stamp_file(const char *path)
{
	struct stat status;

	if (stat(path, &status) != 0)
		return 0;
	return (uint64_t)status.st_mtim.tv_sec * 1000000000 + (uint64_t)status.st_mtim.tv_nsec +
	       (uint64_t)status.st_ino;
}

uint64_t db_users_stamp(const char *path, const struct db_users_keeper *keeper)
{
	char former[PATH_MAX_BYTES];

	db_users_former(path, keeper, former, sizeof(former));
	/* Odd factors: a change of one file is not undone by one of the other. */
	return stamp_file(path) + 3 * (former[0] ? stamp_file(former) : 0);
}

static unsigned long add_text(unsigned long digest, const char *text)
{
	for (const char *at = text; *at; at++)
		digest = digest * 33 + (unsigned char)*at;
	return digest * 33;
}

unsigned long db_users_digest(const struct db_user *user)
{
	unsigned long digest = 5381 + 2 * (unsigned long)user->grant.role + user->pam;

	return add_text(add_text(digest, user->grant.drives), user->hash);
}

/* --- changing --------------------------------------------------------------------------------- */

/* Owner and mode of the old file; without one, the group that reads it. */
static bool give_rights(int fd, const struct stat *old)
{
	const struct group *group = old->st_mode ? NULL : getgrnam(DB_USERS_GROUP);
	struct stat fresh;

	if (fstat(fd, &fresh) != 0)
		return false;
	if (old->st_mode) {
		/* Only root gives files to others: what the page's server writes is its own, and
		 * has the folder's group. Its unit does not even let it try. */
		uid_t owner = geteuid() == 0 ? old->st_uid : fresh.st_uid;
		bool same = fresh.st_uid == owner && fresh.st_gid == old->st_gid;

		return (same || fchown(fd, owner, old->st_gid) == 0) &&
		       fchmod(fd, old->st_mode & 0777) == 0;
	}
	if (group && geteuid() == 0 && fchown(fd, 0, group->gr_gid) != 0)
		return false;
	return fchmod(fd, 0640) == 0;
}

/* The text with the user's line replaced, or without it if `user` is NULL. */
static bool replace_file(const char *path, const char *text, const struct stat *old,
                         const char *name, const struct db_user *user)
{
	size_t size = strlen(name);
	char *other = NULL;
	FILE *file = NULL;
	int fd = -1;
	bool good = false;

	if (asprintf(&other, "%s.XXXXXX", path) < 0)
		return false;
	fd = mkostemp(other, O_CLOEXEC);
	file = fd >= 0 ? fdopen(fd, "w") : NULL;
	if (file) {
		while (*text) {
			size_t length = strcspn(text, "\n");

			if (strncmp(text, name, size) != 0 || text[size] != ':')
				fprintf(file, "%.*s\n", (int)length, text);
			text += length + (text[length] == '\n');
		}
		if (user)
			fprintf(file, "%s:%s:%s:%s\n", user->name, db_role_name(user->grant.role),
			        user->grant.drives, user->pam ? PAM : user->hash);
		good = fflush(file) == 0 && give_rights(fd, old) && fsync(fd) == 0;
		good = fclose(file) == 0 && good;
		good = good && rename(other, path) == 0;
		if (!good) {
			int why = errno;

			(void)unlink(other);
			errno = why;
		}
	} else if (fd >= 0) {
		(void)close(fd);
	}
	free(other);
	return good;
}

/* Two who change it at the same time do so one after the other. The lock; -1 with the reason in
 * `out`. Takes from the tries. */
static int lock_folder(const char *path, bool make, unsigned *tries, FILE *out)
{
	static const struct timespec wait = { .tv_nsec = LOCK_EVERY_MS * 1000000 };
	char *copy = strdup(path);
	const char *folder = copy ? dirname(copy) : NULL;
	int lock = -1;

	/* The folder of all programs' file is made with it: members of the group may replace the
	 * file. */
	if (folder && make) {
		const struct group *group = getgrnam(DB_USERS_GROUP);

		if (mkdir(folder, 0750) == 0 && group && geteuid() == 0 &&
		    chown(folder, 0, group->gr_gid) == 0)
			(void)chmod(folder, 02770);
	}
	lock = folder ? open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
	free(copy);
	if (lock < 0) {
		fprintf(out, "%s: %s\n", path, strerror(errno));
		return -1;
	}
	while (flock(lock, LOCK_EX | LOCK_NB) != 0) {
		if (errno == EWOULDBLOCK && *tries > 0) {
			--*tries;
			(void)nanosleep(&wait, NULL);
			continue;
		}
		fprintf(out, "%s: %s\n", path,
		        errno == EWOULDBLOCK ? "another program is changing it; try again" :
		                               strerror(errno));
		(void)close(lock);
		return -1;
	}
	return lock;
}

static bool can_appoint(const struct db_user *user, bool pam)
{
	return user->grant.role == DB_ROLE_ADMINISTRATOR && (pam || !user->pam);
}

/* Whether somebody can still log in and make users when this user's line is another one. */
static bool leaves_administrator(const struct db_users *users, const char *name,
                                 const struct db_user *user, bool pam)
{
	bool left = user && can_appoint(user, pam);

	for (size_t i = 0; i < users->count && !left; i++)
		left = strcmp(users->list[i].name, name) != 0 && can_appoint(&users->list[i], pam);
	return left;
}

static bool terms_hold(const char *path, const char *name, const struct db_user *user,
                       const struct db_users_terms *terms, FILE *out)
{
	struct db_users users;
	bool good = db_users_load(&users, path, terms->keeper, out);
	const struct db_user *now = db_users_find(&users, name);
	const struct db_user *by = terms->by ? db_users_find(&users, terms->by) : NULL;
	bool as_before = now ? terms->before &&
	                                 db_users_digest(now) == db_users_digest(terms->before) :
	                       !terms->before;

	if (good && terms->by && (!by || by->grant.role != DB_ROLE_ADMINISTRATOR)) {
		fprintf(out, "%s: %s is no administrator any more\n", path, terms->by);
		good = false;
	} else if (good && !as_before) {
		fprintf(out, "%s: the user %s was changed meanwhile\n", path, name);
		good = false;
	} else if (good && now && now->grant.role == DB_ROLE_ADMINISTRATOR &&
	           !leaves_administrator(&users, name, user, terms->pam)) {
		fprintf(out, "%s: no administrator who can log in would be left\n", path);
		good = false;
	}
	db_users_clear(&users);
	return good;
}

/* Puts a user's line into one file, whose folder is locked, or removes it if `user` is NULL. */
static bool change_file(const char *path, const char *name, const struct db_user *user, FILE *out)
{
	struct db_users users = { .list = NULL };
	struct stat status;
	char *text = read_text(path, &status);
	bool good = false;

	if (!text)
		fprintf(out, "%s: %s\n", path, strerror(errno));
	else if (db_users_parse(&users, text, path, out)) {
		if (!user && !db_users_find(&users, name))
			fprintf(out, "%s: there is no user %s\n", path, name);
		else if (user && !db_users_find(&users, name) && users.count + 1 == DB_USERS_MAX)
			fprintf(out, "%s: there are too many users\n", path);
		else if (!replace_file(path, text, &status, name, user))
			fprintf(out, "%s: %s\n", path, strerror(errno));
		else
			good = true;
	}
	db_users_clear(&users);
	if (text)
		explicit_bzero(text, strlen(text));
	free(text);
	return good;
}

/* Whether a name stands in this one file. */
static bool stands_in(const char *path, const char *name)
{
	struct db_users users = { .list = NULL };
	bool found = begin_users(&users) && load_file(&users, path, false, NULL) &&
	             db_users_find(&users, name);

	db_users_clear(&users);
	return found;
}

/* Removes a name from all programs' files of before where it stands in them. */
static bool change_former(const char *path, const char *name, unsigned *tries, FILE *out,
                          bool *found)
{
	static const struct db_users_keeper keepers[] = { { .former = DB_USERS_FORMER_WEB },
		                                          { .former = DB_USERS_FORMER_OPCUA } };
	char former[PATH_MAX_BYTES];
	bool good = true;

	*found = false;
	for (size_t i = 0; i < sizeof(keepers) / sizeof(keepers[0]); i++) {
		int lock;

		db_users_former(path, &keepers[i], former, sizeof(former));
		if (former[0] == '\0' || !stands_in(former, name))
			continue;
		*found = true;
		lock = lock_folder(former, false, tries, out);
		good = lock >= 0 && change_file(former, name, NULL, out) && good;
		if (lock >= 0)
			(void)close(lock);
	}
	return good;
}

bool db_users_put(const char *path, const struct db_user *user, const struct db_users_terms *terms,
                  FILE *out)
{
	unsigned tries = LOCK_TRIES;
	int lock = lock_folder(path, true, &tries, out);
	FILE *nowhere;
	bool found;
	bool good;

	if (lock < 0)
		return false;
	good = (!terms || terms_hold(path, user->name, user, terms, out)) &&
	       change_file(path, user->name, user, out);
	/* Where that cannot be changed, the new line counts all the same. */
	nowhere = good ? fopen("/dev/null", "we") : NULL;
	if (nowhere) {
		(void)change_former(path, user->name, &tries, nowhere, &found);
		(void)fclose(nowhere);
	}
	(void)close(lock);
	return good;
}

bool db_users_remove(const char *path, const char *name, const struct db_users_terms *terms,
                     FILE *out)
{
	unsigned tries = LOCK_TRIES;
	int lock = lock_folder(path, false, &tries, out);
	bool found;
	bool good;

	if (lock < 0)
		return false;
	/* First those of before: an old line must not come to count again. */
	good = (!terms || terms_hold(path, name, NULL, terms, out)) &&
	       change_former(path, name, &tries, out, &found) &&
	       ((found && !stands_in(path, name)) || change_file(path, name, NULL, out));
	(void)close(lock);
	return good;
}
