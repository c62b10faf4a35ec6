/* SPDX-License-Identifier: Apache-2.0 */
#include "upgrade/upgrade.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* Added by the kernel to the path of a file that has lost its name: dpkg gives the name to another
 * file. */
#define REPLACED " (deleted)"

/* The path in a line of maps, without the mark of a replaced file; null: it is no code, or not
 * replaced. */
static char *replaced_path(char *line)
{
	char permissions[5] = "";
	size_t length = strcspn(line, "\n");
	int path = 0;

	line[length] = '\0';
	if (sscanf(line, "%*s %4s %*s %*s %*s %n", permissions, &path) != 1 || path == 0 ||
	    permissions[2] != 'x' || line[path] != '/' ||
	    strncmp(line + path, "/memfd:", strlen("/memfd:")) == 0)
		return NULL;
	if (length < (size_t)path + strlen(REPLACED) ||
	    strcmp(line + length - strlen(REPLACED), REPLACED) != 0)
		return NULL;
	line[length - strlen(REPLACED)] = '\0';
	return line + path;
}

char *db_upgrade_find(FILE *maps, const char *program)
{
	char *line = NULL;
	size_t size = 0;
	char *found = NULL;

	while (!found && getline(&line, &size, maps) > 0) {
		const char *path = replaced_path(line);

		if (path)
			found = strdup(path[1] != '\0' ? path : program);
	}
	free(line);
	return found;
}

char *db_upgrade_look(void)
{
	FILE *maps = fopen("/proc/self/maps", "re");
	char *found = maps ? db_upgrade_find(maps, program_invocation_name) : NULL;

	if (maps)
		fclose(maps);
	return found;
}
