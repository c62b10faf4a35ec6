/* SPDX-License-Identifier: Apache-2.0 */
/* The configuration from the file with a stored copy. */
#include "config/config_private.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* More than the files of any configuration. */
#define COPY_MAX ((off_t)16 << 20)

/* To be freed; null with errno. */
static char *read_text(const char *path)
{
	int fd = open(path, O_RDONLY | O_NOCTTY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
	struct stat about = { 0 };
	char *text = NULL;
	ssize_t got = -1;

	if (fd < 0)
		return NULL;
	if (fstat(fd, &about) == 0 && S_ISREG(about.st_mode) && about.st_size <= COPY_MAX)
		text = malloc((size_t)about.st_size + 1);
	else
		errno = EINVAL;
	if (text)
		got = read(fd, text, (size_t)about.st_size);
	close(fd);
	if (got < 0) {
		free(text);
		return NULL;
	}
	text[got] = '\0';
	return text;
}

int db_config_load_copy(const char *copy, const char *path, FILE *errors, struct db_config **config)
{
	char *text = read_text(copy);
	struct db_source *sources = NULL;
	size_t count = 0;

	if (!text) {
		fprintf(errors, "%s: %s; no configuration was kept there\n", copy, strerror(errno));
		return -1;
	}
	if (!db_copy_read(text, &sources, &count)) {
		fprintf(errors, "%s: it is damaged, and of no use\n", copy);
	} else if (sources[0].profile || strcmp(sources[0].path, path) != 0) {
		fprintf(errors, "%s: it was kept of %s, and not of %s\n", copy, sources[0].path,
		        path);
	} else {
		free(text);
		return db_load_sources(&db_load_built_in, sources, count, errors, config);
	}
	free(text);
	db_sources_free(sources, count);
	return -1;
}
