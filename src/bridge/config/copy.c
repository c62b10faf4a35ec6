/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"

#include "drivebridge/hash.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The first line, with a checksum of the rest: a disk may have lost a part of it. */
#define HEAD "drivebridge: a configuration that was in force, checksum %016" PRIx64 "\n"
#define HEAD_LENGTH 80
/* Before each text: its length and its path. */
#define PART "--- %zu bytes of %s\n"
#define PROFILE_PART "+++ %zu bytes of %s\n"

char *db_copy_write(const struct db_source *sources, size_t count)
{
	char *parts = NULL;
	char *copy = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&parts, &size);
	bool good = out != NULL;

	for (size_t i = 0; good && i < count; i++) {
		good = !strchr(sources[i].path, '\n');
		if (good)
			fprintf(out, sources[i].profile ? PROFILE_PART "%s\n" : PART "%s\n",
			        strlen(sources[i].text), sources[i].path, sources[i].text);
	}
	if (out && (fclose(out) != 0 || !good ||
	            asprintf(&copy, HEAD "%s", db_hash_add(DB_HASH_BEGIN, parts, size), parts) < 0))
		copy = NULL;
	free(parts);
	return copy;
}

bool db_copy_read(const char *text, struct db_source **sources, size_t *count)
{
	char head[HEAD_LENGTH + 1];
	const char *at = strchr(text, '\n');

	*sources = NULL;
	*count = 0;
	if (!at || at[1] == '\0')
		return false;
	at++;
	snprintf(head, sizeof(head), HEAD, db_hash_add(DB_HASH_BEGIN, at, strlen(at)));
	if (strncmp(text, head, (size_t)(at - text)) != 0 || strlen(head) != (size_t)(at - text))
		return false;
	while (*at) {
		struct db_source *more = realloc(*sources, (*count + 1) * sizeof(*more));
		struct db_source *part;
		const char *end;
		size_t length;
		int path;

		if (!more)
			return false;
		*sources = more;
		part = &more[(*count)++];
		*part = (struct db_source){ .profile = *at == '+' };
		end = strchr(at, '\n');
		length = 0;
		path = 0;
		if (!end ||
		    sscanf(at, part->profile ? "+++ %zu bytes of %n" : "--- %zu bytes of %n",
		           &length, &path) != 1 ||
		    path == 0 || at + path >= end || strnlen(end + 1, length + 1) != length + 1 ||
		    end[1 + length] != '\n')
			return false;
		/* gcc's analyzer takes them for lost: db_sources_free() frees them. */
		part->path = strndup(at + path, (size_t)(end - at - path));
		part->text = strndup(end + 1, length);
		if (!part->path || !part->text)
			return false;
		at = end + 1 + length + 1;
	}
	return true;
}
