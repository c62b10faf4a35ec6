/* SPDX-License-Identifier: Apache-2.0 */
#include "upgrade/upgrade.h"

#include <stdlib.h>
#include <string.h>

/* Added by the kernel to the path of a file that has lost its name: dpkg gives the name to another
 * file. */
#define REPLACED " (deleted)"

char *db_upgrade_find(FILE *maps)
{
	char *line = NULL;
	size_t size = 0;
	char *found = NULL;

	while (!found && getline(&line, &size, maps) > 0) {
		char permissions[5] = "";
		size_t length = strcspn(line, "\n");
		int path = 0;

		/* Code, from a file and not from memory. */
		line[length] = '\0';
		if (sscanf(line, "%*s %4s %*s %*s %*s %n", permissions, &path) != 1 || path == 0 ||
		    permissions[2] != 'x' || line[path] != '/' ||
		    strncmp(line + path, "/memfd:", strlen("/memfd:")) == 0)
			continue;
		/* The mark of a replaced file stands behind its path. */
		if (length < (size_t)path + strlen(REPLACED) ||
		    strcmp(line + length - strlen(REPLACED), REPLACED) != 0)
			continue;
		line[length - strlen(REPLACED)] = '\0';
		found = strdup(line + path);
	}
	free(line);
	return found;
}

char *db_upgrade_look(void)
{
	FILE *maps = fopen("/proc/self/maps", "re");
	char *found = maps ? db_upgrade_find(maps) : NULL;

	if (maps)
		fclose(maps);
	return found;
}
