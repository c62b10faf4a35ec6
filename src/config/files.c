/* SPDX-License-Identifier: Apache-2.0 */
#include "config/files.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILE_MAX ((size_t)1 << 20)
#define FOLDER "conf.d"
#define SUFFIX ".conf"

/* --- one file --------------------------------------------------------------------------------- */

static void explain_open(const char *path, int error, FILE *errors)
{
	if (error == ENOENT)
		fprintf(errors,
		        "%s: there is no such file; correct the path, or begin with one of "
		        "/usr/share/doc/drivebridge/examples\n",
		        path);
	else if (error == EACCES)
		fprintf(errors,
		        "%s: this user (%u) may not read it; the service reads it as the user "
		        "drivebridge: sudo chmod a+r FILE, and a+x for its folders\n",
		        path, (unsigned)geteuid());
	else
		fprintf(errors, "%s: %s; the path of a readable configuration file\n", path,
		        strerror(error));
}

/* Whatever is read for ever, or never ends, is no file. */
static bool is_file(const char *path, const struct stat *about, FILE *errors)
{
	if (S_ISREG(about->st_mode))
		return true;
	fprintf(errors, "%s: it is %s, not a file; the path of a configuration file\n", path,
	        S_ISDIR(about->st_mode)  ? "a folder" :
	        S_ISFIFO(about->st_mode) ? "a pipe" :
	        S_ISSOCK(about->st_mode) ? "a socket" :
	                                   "a device");
	return false;
}

static unsigned line_at(const char *text, size_t offset)
{
	unsigned line = 1;

	for (size_t i = 0; i < offset; i++)
		line += text[i] == '\n';
	return line;
}

/* What no text of a configuration has. */
static bool is_text(const char *path, const char *text, size_t length, FILE *errors)
{
	if (length > FILE_MAX) {
		fprintf(errors,
		        "%s: it is longer than 1 MiB; is it the right file? If it is, spread it over "
		        "several in the folder " FOLDER " beside it\n",
		        path);
		return false;
	}
	if (length >= 2 && (memcmp(text, "\xFF\xFE", 2) == 0 || memcmp(text, "\xFE\xFF", 2) == 0)) {
		fprintf(errors,
		        "%s:1: it is UTF-16 text; save it as UTF-8 without byte order mark, or: "
		        "iconv -f UTF-16 -t UTF-8\n",
		        path);
		return false;
	}
	if (length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
		fprintf(errors,
		        "%s:1: it begins with an invisible byte order mark; save it as UTF-8 without "
		        "byte order mark (BOM)\n",
		        path);
		return false;
	}
	if (strlen(text) != length) {
		fprintf(errors,
		        "%s:%u: there is a zero byte; it is damaged, or UTF-16 text: save it as UTF-8\n",
		        path, line_at(text, strlen(text)));
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
		explain_open(path, errno, errors);
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

/* False after a message. O_NONBLOCK: a pipe without a writer would be waited for. */
static bool read_source(const char *path, FILE *errors, struct db_source *source)
{
	int fd = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
	struct stat about;

	if (fd < 0 || fstat(fd, &about) != 0)
		explain_open(path, errno, errors);
	else if (is_file(path, &about, errors))
		source->text = read_text(path, fd, &about, errors);
	if (fd >= 0)
		close(fd);
	if (!source->text)
		return false;
	source->path = strdup(path);
	/* gcc's analyzer takes it for lost: it is the list's, which is freed as a whole. */
	if (source->path)
		return true;
	explain_open(path, ENOMEM, errors);
	return false;
}

/* --- the folder ------------------------------------------------------------------------------- */

static int is_ours(const struct dirent *entry)
{
	size_t length = strlen(entry->d_name);

	return entry->d_name[0] != '.' && length > strlen(SUFFIX) &&
	       strcmp(entry->d_name + length - strlen(SUFFIX), SUFFIX) == 0;
}

/* The same order in every locale. */
static int by_name(const struct dirent **a, const struct dirent **b)
{
	return strcmp((*a)->d_name, (*b)->d_name);
}

/* The folder beside the file; to be freed. */
static char *folder_beside(const char *path)
{
	const char *slash = strrchr(path, '/');
	char *folder;

	return asprintf(&folder, "%.*s" FOLDER, slash ? (int)(slash - path + 1) : 0, path) < 0 ?
	               NULL :
	               folder;
}

static bool read_entry(const char *folder, const char *name, FILE *errors, struct db_source *source)
{
	char *path;
	bool good;

	if (asprintf(&path, "%s/%s", folder, name) < 0)
		return false;
	good = read_source(path, errors, source);
	free(path);
	return good;
}

/* Appends to the one source that is there. */
static bool read_folder(const char *path, FILE *errors, struct db_source **sources, size_t *count)
{
	char *folder = folder_beside(path);
	struct dirent **entries = NULL;
	struct db_source *more = NULL;
	int found = folder ? scandir(folder, &entries, is_ours, by_name) : -1;
	bool good = folder && (found >= 0 || errno == ENOENT || errno == ENOTDIR);

	if (!good)
		explain_open(folder ? folder : path, errno, errors);
	if (found > 0)
		more = realloc(*sources, ((size_t)found + 1) * sizeof(**sources));
	if (more)
		*sources = more;
	else if (found > 0)
		good = false;
	for (int i = 0; i < found; i++) {
		if (more) {
			more[*count] = (struct db_source){ 0 };
			if (!read_entry(folder, entries[i]->d_name, errors, &more[(*count)++]))
				good = false;
		}
		free(entries[i]);
	}
	free(entries);
	free(folder);
	return good;
}

int db_files_read(const char *path, FILE *errors, struct db_source **sources, size_t *count)
{
	bool good;

	*count = 1;
	*sources = calloc(1, sizeof(**sources));
	if (!*sources) {
		*count = 0;
		explain_open(path, ENOMEM, errors);
		return -1;
	}
	good = read_source(path, errors, *sources);
	good = read_folder(path, errors, sources, count) && good;
	return good ? 0 : -1;
}
