/* SPDX-License-Identifier: Apache-2.0 */
#include "users/users.h"

#include <crypt.h>
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* yescrypt with 4 MiB: its usual 16 MiB would exceed the rest of the program, for as long as a
 * login takes. */
#define METHOD "$y$"
#define COST 3

bool db_users_name_is_good(const char *name)
{
	static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
				      "0123456789.-_";
	size_t length = strlen(name);

	return length >= 1 && length <= DB_USERS_NAME_MAX && strspn(name, letters) == length &&
	       !strchr(".-_", name[0]);
}

bool db_role_read(const char *word, enum db_role *role)
{
	for (enum db_role one = DB_ROLE_READER; one <= DB_ROLE_OPERATOR; one++) {
		if (strcmp(word, db_role_name(one)) == 0) {
			*role = one;
			return true;
		}
	}
	return false;
}

/* The characters of a hash, by crypt(5). */
static bool is_hash(const char *text)
{
	size_t length = strlen(text);

	if (length < 13 || length >= sizeof(((struct db_user *)0)->hash) || text[0] != '$')
		return false;
	for (size_t i = 0; i < length; i++) {
		if (text[i] <= ' ' || text[i] > '~' || strchr(":;*!\\", text[i]))
			return false;
	}
	return true;
}

/* Splits a line at its colons. NULL: it is valid, else the mistake. */
static const char *parse_line(char *line, struct db_user *user)
{
	char *role = strchr(line, ':');
	char *hash = role ? strchr(role + 1, ':') : NULL;

	if (!hash)
		return "a line is NAME:ROLE:HASH";
	*role++ = '\0';
	*hash++ = '\0';
	if (!db_users_name_is_good(line))
		return "a name has 1 to 32 letters, digits, '.', '-' and '_'";
	if (!db_role_read(role, &user->role))
		return "a role is reader or operator";
	if (!is_hash(hash))
		return "this is no hash of a password; --add-user makes them";
	/* Both fit, as checked above. */
	memcpy(user->name, line, strlen(line) + 1);
	memcpy(user->hash, hash, strlen(hash) + 1);
	return NULL;
}

bool db_users_parse(struct db_users *users, const char *text, const char *path, FILE *out)
{
	char line[512];
	unsigned number = 0;
	bool good = true;

	*users = (struct db_users){ .list = calloc(DB_USERS_MAX, sizeof(*users->list)) };
	if (!users->list)
		return false;
	while (*text) {
		size_t length = strcspn(text, "\n");
		struct db_user *user = &users->list[users->count];
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
				if (!why && db_users_find(users, user->name))
					why = "this name stands there already";
				users->count += !why;
			}
		}
		if (why && out)
			(void)fprintf(out, "%s:%u: %s\n", path, number, why);
		good = good && !why;
		/* gcc's analyzer, likewise */
		text += length + (text[length] == '\n');
	}
	explicit_bzero(line, sizeof(line));
	return good;
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

bool db_users_load(struct db_users *users, const char *path, const struct db_users_keeper *keeper,
                   FILE *out)
{
	struct stat status;
	char *text = read_text(path, &status);
	bool good = false;

	*users = (struct db_users){ .list = NULL };
	if (!text) {
		if (out)
			(void)fprintf(out, "%s: %s\n", path, strerror(errno));
	} else if (status.st_mode & (S_IROTH | S_IWOTH)) {
		if (out)
			(void)fprintf(out,
			              "%s: can be read or written by everybody: chmod 0640 %s, and "
			              "chgrp it to the group %s\n",
			              path, path, keeper->group);
	} else {
		good = db_users_parse(users, text, path, out);
	}
	if (text)
		explicit_bzero(text, strlen(text));
	free(text);
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
		if (strcmp(users->list[i].name, name) == 0)
			return &users->list[i];
	}
	return NULL;
}

uint64_t db_users_stamp(const char *path)
{
	struct stat status;

	if (stat(path, &status) != 0)
		return 0;
	return (uint64_t)status.st_mtim.tv_sec * 1000000000 + (uint64_t)status.st_mtim.tv_nsec +
	       (uint64_t)status.st_ino;
}

unsigned long db_users_digest(const struct db_user *user)
{
	unsigned long digest = 5381 + (unsigned long)user->role;

	for (const char *at = user->hash; *at; at++)
		digest = digest * 33 + (unsigned char)*at;
	return digest;
}

/* --- changing --------------------------------------------------------------------------------- */

/* The text without the user's line. */
static void put_others(FILE *file, const char *text, const char *name)
{
	size_t size = strlen(name);

	while (*text) {
		size_t length = strcspn(text, "\n");

		if (strncmp(text, name, size) != 0 || text[size] != ':')
			(void)fprintf(file, "%.*s\n", (int)length, text);
		text += length + (text[length] == '\n');
	}
}

/* Owner and mode of the former file; without one, the group that reads it. */
static bool give_rights(const struct db_users_keeper *keeper, int fd, const struct stat *old)
{
	const struct group *group = old->st_mode ? NULL : getgrnam(keeper->group);

	if (old->st_mode)
		return fchown(fd, old->st_uid, old->st_gid) == 0 &&
		       fchmod(fd, old->st_mode & 0777) == 0;
	/* Another user than root owns the new file. */
	if (group && geteuid() == 0 && fchown(fd, 0, group->gr_gid) != 0)
		return false;
	return fchmod(fd, 0640) == 0;
}

static bool replace_file(const struct db_users_keeper *keeper, const char *path, const char *text,
                         const struct stat *old, const char *name, enum db_role role,
                         const char *hash)
{
	char *other = NULL;
	FILE *file = NULL;
	int fd = -1;
	bool good = false;

	if (asprintf(&other, "%s.XXXXXX", path) < 0)
		return false;
	fd = mkostemp(other, O_CLOEXEC);
	file = fd >= 0 ? fdopen(fd, "w") : NULL;
	if (file) {
		put_others(file, text, name);
		if (hash)
			(void)fprintf(file, "%s:%s:%s\n", name, db_role_name(role), hash);
		good = fflush(file) == 0 && give_rights(keeper, fd, old) && fsync(fd) == 0;
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

bool db_users_change(const struct db_users_keeper *keeper, const char *path, const char *name,
                     enum db_role role, const char *hash, FILE *out)
{
	const char *slash = strrchr(path, '/');
	char *folder = slash ? strndup(path, (size_t)(slash - path) + 1) : strdup(".");
	int lock = folder ? open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
	struct db_users users = { .list = NULL };
	struct stat status;
	char *text = NULL;
	bool good = false;

	/* Two administrators at the same time: one after the other. */
	if (lock >= 0 && flock(lock, LOCK_EX) == 0)
		text = read_text(path, &status);
	if (!text)
		(void)fprintf(out, "%s: %s\n", path, strerror(errno));
	else if (db_users_parse(&users, text, path, out)) {
		if (!hash && !db_users_find(&users, name))
			(void)fprintf(out, "%s: there is no user %s\n", path, name);
		else if (hash && !db_users_find(&users, name) && users.count + 1 == DB_USERS_MAX)
			(void)fprintf(out, "%s: there are too many users\n", path);
		else if (!replace_file(keeper, path, text, &status, name, role, hash))
			(void)fprintf(out, "%s: %s\n", path, strerror(errno));
		else
			good = true;
	}
	db_users_clear(&users);
	free(text);
	free(folder);
	if (lock >= 0)
		(void)close(lock);
	return good;
}

bool db_users_hash(const char *password, char *hash, size_t size)
{
	char setting[CRYPT_GENSALT_OUTPUT_SIZE];
	struct crypt_data *data = calloc(1, sizeof(*data));
	const char *made = NULL;

	if (data && crypt_gensalt_rn(METHOD, COST, NULL, 0, setting, sizeof(setting)))
		made = crypt_rn(password, setting, data, sizeof(*data));
	if (made && strlen(made) < size)
		(void)snprintf(hash, size, "%s", made);
	else
		made = NULL;
	if (data)
		explicit_bzero(data, sizeof(*data));
	free(data);
	return made;
}

/* Takes a time that does not depend on how much of it is right. */
bool db_users_has_password(const char *hash, const char *password)
{
	struct crypt_data *data = calloc(1, sizeof(*data));
	const char *made = data ? crypt_rn(password, hash, data, sizeof(*data)) : NULL;
	size_t length = strlen(hash);
	unsigned char differ = 0;
	bool right = false;

	if (made && made[0] != '*' && strlen(made) == length) {
		for (size_t i = 0; i < length; i++)
			differ |= (unsigned char)(made[i] ^ hash[i]);
		right = differ == 0;
	}
	if (data)
		explicit_bzero(data, sizeof(*data));
	free(data);
	return right;
}
