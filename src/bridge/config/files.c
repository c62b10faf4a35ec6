/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"
#include "reader/source.h"

#include "drivebridge/config.h"
#include "drivebridge/hash.h"

#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define FOLDER "conf.d"
#define EDITED "edited/edited.conf"
#define SUFFIX ".conf"

/* False after a message. */
static bool read_source(const char *path, FILE *errors, struct db_source *source)
{
	source->text = db_file_read(path, errors);
	if (!source->text)
		return false;
	source->path = strdup(path);
	/* gcc's analyzer takes it for lost: it is the list's, which is freed as a whole. */
	if (source->path)
		return true;
	db_file_explain(path, ENOMEM, errors);
	return false;
}

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

/* A name in the folder of the file; to be freed. */
static char *name_beside(const char *path, const char *name)
{
	const char *slash = strrchr(path, '/');
	char *made;

	return asprintf(&made, "%.*s%s", slash ? (int)(slash - path + 1) : 0, path, name) < 0 ?
	               NULL :
	               made;
}

char *db_config_edited_path(const char *path)
{
	return name_beside(path, EDITED);
}

/* Appends to the one source already there. */
static bool read_folder(const char *path, FILE *errors, struct db_source **sources, size_t *count)
{
	char *folder = name_beside(path, FOLDER);
	struct dirent **entries = NULL;
	struct db_source *more = NULL;
	int found = folder ? scandir(folder, &entries, is_ours, by_name) : -1;
	bool good = folder && (found >= 0 || errno == ENOENT || errno == ENOTDIR);

	if (!good)
		db_file_explain(folder ? folder : path, errno, errors);
	if (found > 0)
		more = realloc(*sources, ((size_t)found + 1) * sizeof(**sources));
	if (more)
		*sources = more;
	else if (found > 0)
		good = false;
	for (int i = 0; i < found; i++) {
		if (more) {
			struct db_source *source = &more[(*count)++];
			char *entry = NULL;

			*source = (struct db_source){ 0 };
			if (asprintf(&entry, "%s/%s", folder, entries[i]->d_name) < 0)
				entry = NULL;
			good = entry && read_source(entry, errors, source) && good;
			free(entry);
		}
		free(entries[i]);
	}
	free(entries);
	free(folder);
	return good;
}

/* Appends the edited file, if there is one; with `text` as if that were its content. */
static bool read_edited(const char *path, const char *text, FILE *errors,
                        struct db_source **sources, size_t *count)
{
	char *edited = db_config_edited_path(path);
	struct db_source *more;
	struct stat about;
	bool good = false;

	if (edited && !text && stat(edited, &about) != 0 && (errno == ENOENT || errno == ENOTDIR)) {
		free(edited);
		return true;
	}
	more = edited ? realloc(*sources, (*count + 1) * sizeof(*more)) : NULL;
	if (more) {
		*sources = more;
		more[*count] = (struct db_source){ .edited = true };
		if (!text) {
			good = read_source(edited, errors, &more[(*count)++]);
		} else {
			struct db_source *made = &more[(*count)++];

			/* gcc's analyzer loses that the caller has them through `sources`. */
			made->path = strdup(edited);
			made->text = strdup(text);
			good = made->path && made->text;
		}
	}
	if (!more || (text && !good))
		db_file_explain(path, ENOMEM, errors);
	free(edited);
	return good;
}

int db_files_read(const char *path, const char *edited, FILE *errors, struct db_source **sources,
                  size_t *count)
{
	bool good;

	*count = 1;
	*sources = calloc(1, sizeof(**sources));
	if (!*sources) {
		*count = 0;
		db_file_explain(path, ENOMEM, errors);
		return -1;
	}
	good = read_source(path, errors, *sources);
	good = read_folder(path, errors, sources, count) && good;
	good = read_edited(path, edited, errors, sources, count) && good;
	return good ? 0 : -1;
}

/* --- whether they are others than before ------------------------------------------------------ */

/* The time of the last change of content, name, owner or mode is enough, except for a different
 * file with this name. */
static uint64_t add_file(uint64_t sum, const char *path)
{
	struct stat about = { 0 };
	int error = stat(path, &about) == 0 ? 0 : errno;

	sum = db_hash_add(sum, &error, sizeof(error));
	sum = db_hash_add(sum, &about.st_dev, sizeof(about.st_dev));
	sum = db_hash_add(sum, &about.st_ino, sizeof(about.st_ino));
	sum = db_hash_add(sum, &about.st_size, sizeof(about.st_size));
	sum = db_hash_add(sum, &about.st_ctim.tv_sec, sizeof(about.st_ctim.tv_sec));
	sum = db_hash_add(sum, &about.st_ctim.tv_nsec, sizeof(about.st_ctim.tv_nsec));
	sum = db_hash_add(sum, &about.st_mtim.tv_sec, sizeof(about.st_mtim.tv_sec));
	return db_hash_add(sum, &about.st_mtim.tv_nsec, sizeof(about.st_mtim.tv_nsec));
}

uint64_t db_config_signature(const char *path, const char *profiles)
{
	uint64_t sum = DB_HASH_BEGIN;
	char *folder = name_beside(path, FOLDER);
	char *edited = db_config_edited_path(path);
	struct dirent **entries = NULL;
	int found = folder ? scandir(folder, &entries, is_ours, by_name) : 0;
	int error = found < 0 ? errno : 0;

	sum = add_file(sum, path);
	if (edited)
		sum = add_file(sum, edited);
	free(edited);
	sum = db_hash_add(sum, &error, sizeof(error));
	for (int i = 0; i < found; i++) {
		char *entry;

		sum = db_hash_add(sum, entries[i]->d_name, strlen(entries[i]->d_name) + 1);
		if (asprintf(&entry, "%s/%s", folder, entries[i]->d_name) >= 0) {
			sum = add_file(sum, entry);
			free(entry);
		}
		free(entries[i]);
	}
	free(entries);
	free(folder);
	for (; profiles && *profiles; profiles += strlen(profiles) + 1)
		sum = add_file(sum, profiles);
	return sum != 0 ? sum : 1;
}
