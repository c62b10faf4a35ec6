/* SPDX-License-Identifier: Apache-2.0 */
/* Checks whether a file is complete: the drives' behaviour must not depend on a disk that was
 * full. */
#include "drivebridge/config.h"
#include "reader/source.h"

#include <stdlib.h>
#include <string.h>

static struct db_source *find_source(const struct db_config *config, const char *path)
{
	for (size_t i = 0; i < config->source_count; i++) {
		if (strcmp(config->sources[i].path, path) == 0)
			return &config->sources[i];
	}
	return NULL;
}

static bool explain_cut(const char *path, const char *fault, char **why)
{
	if (asprintf(why, "%s: %s", path, fault) < 0)
		*why = NULL;
	return true;
}

bool db_config_is_cut(const struct db_config *running, const struct db_config *next, char **why)
{
	*why = NULL;
	if (next->bus_count == 0 && running->bus_count > 0)
		return explain_cut(
			next->sources[0].path,
			"it has no bus any more, as if it had been cut off; to run none, stop the "
			"service, or start it anew with this file",
			why);
	if (next->drive_count == 0 && running->drive_count > 0 && !next->sources[0].ended)
		return explain_cut(
			next->sources[0].path,
			"it has no drive any more, as if it had been cut off; if it is complete, "
			"put a line with the word end last",
			why);
	for (size_t i = 0; i < next->source_count; i++) {
		const struct db_source *source = &next->sources[i];
		const struct db_source *before = find_source(running, source->path);

		if (before && before->ended && !source->ended)
			return explain_cut(
				source->path,
				"its last line was end and is not any more, so a part of it may "
				"be missing; put end back when it is complete",
				why);
	}
	return false;
}

void db_config_keep_ends(struct db_config *running, const struct db_config *next)
{
	for (size_t i = 0; i < next->source_count; i++) {
		struct db_source *before = find_source(running, next->sources[i].path);

		if (before)
			before->ended = next->sources[i].ended;
	}
}
