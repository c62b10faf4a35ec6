/* SPDX-License-Identifier: Apache-2.0 */
#include "reader/source.h"

#include <stdlib.h>
#include <string.h>

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
