/* SPDX-License-Identifier: Apache-2.0 */
#include "web/page.h"
#include "client/log.h"

#include "drivebridge/hash.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILES_MAX 128
#define FILE_MAX ((off_t)1024 * 1024)
#define PACKED ".gz"

struct db_web_page {
	size_t count;
	struct db_web_file files[FILES_MAX];
};

/* NULL: a file of this name is not served. */
static const char *find_type(const char *name)
{
	static const struct {
		const char *end;
		const char *type;
	} types[] = {
		{ ".html", "text/html; charset=utf-8" },
		{ ".css", "text/css; charset=utf-8" },
		{ ".js", "text/javascript; charset=utf-8" },
		{ ".svg", "image/svg+xml" },
		{ ".png", "image/png" },
		{ ".ico", "image/x-icon" },
		{ ".txt", "text/plain; charset=utf-8" },
		{ ".mo", "application/octet-stream" },
	};
	size_t length = strlen(name);

	if (name[0] == '.' ||
	    strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") !=
	            length)
		return NULL;
	for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++) {
		size_t size = strlen(types[i].end);

		if (length > size && strcmp(name + length - size, types[i].end) == 0)
			return types[i].type;
	}
	return NULL;
}

/* NULL with errno: ENOENT where nothing may be served. */
static void *read_file(int folder, const char *name, size_t *size)
{
	int fd = openat(folder, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
	struct stat status;
	char *bytes = NULL;
	size_t used = 0;
	ssize_t got = 1;

	if (fd < 0 || fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
		if (fd >= 0)
			(void)close(fd);
		errno = ENOENT;
		return NULL;
	}
	if (status.st_size > FILE_MAX)
		errno = EFBIG;
	else
		bytes = malloc((size_t)status.st_size + 1);
	while (bytes && got > 0 && used < (size_t)status.st_size) {
		got = read(fd, bytes + used, (size_t)status.st_size - used);
		used += got > 0 ? (size_t)got : 0;
	}
	if (bytes && used < (size_t)status.st_size) {
		free(bytes);
		bytes = NULL;
		errno = EIO;
	}
	(void)close(fd);
	*size = used;
	return bytes;
}

/* False: a file of the page cannot be read. */
static bool add_file(struct db_web_page *page, int folder, const char *name)
{
	struct db_web_file *file = &page->files[page->count];
	const char *type = find_type(name);
	char packed[NAME_MAX + sizeof(PACKED)];

	if (!type)
		return true;
	if (page->count == FILES_MAX) {
		errno = EMFILE;
		return false;
	}
	file->bytes = read_file(folder, name, &file->size);
	if (!file->bytes)
		return errno == ENOENT;
	page->count++;
	file->type = type;
	file->name = strdup(name);
	if (!file->name)
		return false;
	snprintf(file->etag, sizeof(file->etag), "\"%016llx\"",
	         (unsigned long long)db_hash_add(DB_HASH_BEGIN, file->bytes, file->size));
	snprintf(packed, sizeof(packed), "%s" PACKED, name);
	file->packed = read_file(folder, packed, &file->packed_size);
	return file->packed || errno == ENOENT;
}

struct db_web_page *db_web_page_load(const char *folder)
{
	struct db_web_page *page = calloc(1, sizeof(*page));
	DIR *list = opendir(folder);
	const struct dirent *entry;
	bool good = page && list;

	while (good && (entry = readdir(list))) {
		good = add_file(page, dirfd(list), entry->d_name);
		if (!good)
			db_client_log(DB_CLIENT_ERROR, "%s/%s: %s", folder, entry->d_name,
			              strerror(errno));
	}
	if (!list)
		db_client_log(DB_CLIENT_ERROR, "no page to serve: %s: %s", folder, strerror(errno));
	else
		(void)closedir(list);
	if (good && !db_web_page_find(page, "index.html")) {
		db_client_log(DB_CLIENT_ERROR, "no page to serve: there is no index.html in %s",
		              folder);
		good = false;
	}
	if (good)
		return page;
	db_web_page_free(page);
	return NULL;
}

void db_web_page_free(struct db_web_page *page)
{
	for (size_t i = 0; page && i < page->count; i++) {
		free(page->files[i].name);
		free(page->files[i].bytes);
		free(page->files[i].packed);
	}
	free(page);
}

const struct db_web_file *db_web_page_find(const struct db_web_page *page, const char *name)
{
	for (size_t i = 0; i < page->count; i++) {
		if (strcmp(page->files[i].name, name) == 0)
			return &page->files[i];
	}
	return NULL;
}
