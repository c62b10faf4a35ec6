/* SPDX-License-Identifier: Apache-2.0 */
#include "reader/source.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILE_MAX ((size_t)1 << 20)

void db_file_explain(const char *path, int error, FILE *errors)
{
	if (error == ENOENT)
		fprintf(errors,
		        "%s: there is no such file; correct the path, or begin with an example in "
		        "/usr/share/doc/drivebridge or /etc/drivebridge\n",
		        path);
	else if (error == EACCES)
		fprintf(errors,
		        "%s: this user (%u) may not read it; services have users of their own: "
		        "sudo "
		        "chmod a+r FILE, and a+x for its folders\n",
		        path, (unsigned)geteuid());
	else
		fprintf(errors, "%s: %s; the path of a readable configuration file\n", path,
		        strerror(error));
}

/* Checks for bytes that no text of a configuration has. */
static bool is_text(const char *path, const char *text, size_t length, FILE *errors)
{
	if (length > FILE_MAX) {
		fprintf(errors, "%s: it is longer than 1 MiB; is it the right file?\n", path);
		return false;
	}
	if (length >= 2 && (((uint8_t)text[0] == 0xFF && (uint8_t)text[1] == 0xFE) ||
	                    ((uint8_t)text[0] == 0xFE && (uint8_t)text[1] == 0xFF))) {
		fprintf(errors,
		        "%s:1: it is UTF-16 text; save it as UTF-8 without byte order mark, or: "
		        "iconv -f UTF-16 -t UTF-8\n",
		        path);
		return false;
	}
	if (length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
		fprintf(errors,
		        "%s:1: it begins with an invisible byte order mark; save it as UTF-8 "
		        "without "
		        "byte order mark (BOM)\n",
		        path);
		return false;
	}
	if (strlen(text) != length) {
		unsigned line = 1;

		for (const char *at = text; *at; at++)
			line += *at == '\n';
		fprintf(errors,
		        "%s:%u: there is a zero byte; it is damaged, or UTF-16 text: save it as "
		        "UTF-8\n",
		        path, line);
		return false;
	}
	return true;
}

/* Null after a message. */
static char *read_text(const char *path, int fd, const struct stat *before, FILE *errors)
{
	char *text = malloc(FILE_MAX + 2);
	struct stat after;
	size_t length = 0;
	ssize_t got = 1;

	while (text && got > 0 && length <= FILE_MAX) {
		got = read(fd, text + length, FILE_MAX + 1 - length);
		length += got > 0 ? (size_t)got : 0;
	}
	if (!text || got < 0) {
		db_file_explain(path, errno, errors);
		free(text);
		return NULL;
	}
	text[length] = '\0';
	if (fstat(fd, &after) != 0 || after.st_size != before->st_size ||
	    after.st_mtim.tv_sec != before->st_mtim.tv_sec ||
	    after.st_mtim.tv_nsec != before->st_mtim.tv_nsec) {
		fprintf(errors, "%s: it was being written while it was read; try again\n", path);
		free(text);
		return NULL;
	}
	if (!is_text(path, text, length, errors)) {
		free(text);
		return NULL;
	}
	return text;
}

char *db_file_read(const char *path, FILE *errors)
{
	/* Opening a pipe without a writer would block. */
	int fd = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
	struct stat about;
	char *text = NULL;

	if (fd < 0 || fstat(fd, &about) != 0)
		db_file_explain(path, errno, errors);
	else if (S_ISREG(about.st_mode))
		text = read_text(path, fd, &about, errors);
	else /* to read anything else may block, or may never end */
		fprintf(errors, "%s: it is %s, not a file; the path of a configuration file\n",
		        path,
		        S_ISDIR(about.st_mode)  ? "a folder" :
		        S_ISFIFO(about.st_mode) ? "a pipe" :
		        S_ISSOCK(about.st_mode) ? "a socket" :
		                                  "a device");
	if (fd >= 0)
		close(fd);
	return text;
}

struct db_source *db_sources_of_text(const char *path, const char *text)
{
	struct db_source *source = calloc(1, sizeof(*source));

	if (!source)
		return NULL;
	source->path = strdup(path);
	source->text = strdup(text);
	if (!source->path || !source->text) {
		db_sources_free(source, 1);
		return NULL;
	}
	return source;
}

void db_sources_count_lines(struct db_source *sources, size_t count)
{
	unsigned lines = 0;

	for (size_t i = 0; i < count; i++) {
		sources[i].lines_before = lines;
		for (const char *at = sources[i].text; *at; at++)
			lines += *at == '\n';
		lines++;
	}
}

void db_sources_forget_texts(struct db_source *sources, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		free(sources[i].text);
		sources[i].text = NULL;
	}
}

void db_sources_free(struct db_source *sources, size_t count)
{
	for (size_t i = 0; sources && i < count; i++) {
		free(sources[i].path);
		free(sources[i].text);
	}
	free(sources);
}
