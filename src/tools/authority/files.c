/* SPDX-License-Identifier: Apache-2.0 */
#include "authority/files.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool fail(const char *path)
{
	fprintf(stderr, "%s: %s\n", path, strerror(errno));
	return false;
}

static bool make_path(char path[PATH_MAX], const char *folder, const char *name, const char *end)
{
	if (snprintf(path, PATH_MAX, "%s/%s.pem%s", folder, name, end) < PATH_MAX)
		return true;
	errno = ENAMETOOLONG;
	return fail(folder);
}

/* Whom it belongs to and who may read it, before anything is in it. */
static bool protect(int fd, const char *group)
{
	const struct group *found;

	if (!group)
		return fchmod(fd, 0644) == 0;
	found = group[0] != '\0' ? getgrnam(group) : NULL;
	if (!found)
		return fchmod(fd, 0600) == 0;
	return fchown(fd, (uid_t)-1, found->gr_gid) == 0 && fchmod(fd, 0640) == 0;
}

static bool write_all(int fd, const struct db_authority_text *text)
{
	size_t done = 0;

	while (done < text->size) {
		ssize_t count = write(fd, text->bytes + done, text->size - done);

		if (count < 0)
			return false;
		done += (size_t)count;
	}
	return fsync(fd) == 0;
}

bool db_authority_write(const char *folder, const char *name, const struct db_authority_text *text,
                        bool replace)
{
	char path[PATH_MAX];
	char fresh[PATH_MAX];
	bool good;
	int fd;

	if (!make_path(path, folder, name, "") || !make_path(fresh, folder, name, ".new"))
		return false;
	(void)unlink(fresh);
	fd = open(fresh, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
	if (fd < 0)
		return fail(fresh);
	good = protect(fd, text->group) && write_all(fd, text);
	if (!good)
		(void)fail(fresh);
	(void)close(fd);
	/* A link does not replace what is there. */
	if (good && !replace && link(fresh, path) != 0)
		good = fail(path);
	if (good && replace && rename(fresh, path) != 0)
		good = fail(path);
	(void)unlink(fresh);
	return good;
}

bool db_authority_read(const char *folder, const char *name, struct db_certificate_file *file)
{
	char why[DB_CERTIFICATE_WHY];
	char path[PATH_MAX];

	*file = (struct db_certificate_file){ .bytes = NULL };
	if (!make_path(path, folder, name, ""))
		return false;
	if (db_certificate_file_read(file, path, why))
		return true;
	fprintf(stderr, "%s: %s\n", path, why);
	return false;
}
