/* SPDX-License-Identifier: Apache-2.0 */
/* regmap-export: writes the generated documents to standard output. */
#include "regmap/export.h"

#include <stdlib.h>
#include <string.h>

static const struct {
	const char *name;
	int (*export)(FILE *out);
} documents[] = {
	{ "csv", db_export_csv },
	{ "md", db_export_markdown },
	{ "commands", db_export_commands },
};

#define DOCUMENTS (sizeof documents / sizeof documents[0])

int main(int argc, char **argv)
{
	for (size_t i = 0; argc == 2 && i < DOCUMENTS; i++) {
		if (strcmp(argv[1], documents[i].name) != 0)
			continue;
		if (documents[i].export(stdout) != 0 || fflush(stdout) != 0) {
			perror("regmap-export");
			return EXIT_FAILURE;
		}
		return EXIT_SUCCESS;
	}
	fprintf(stderr, "usage: regmap-export csv|md|commands\n");
	return 2;
}
