/* SPDX-License-Identifier: Apache-2.0 */
/* regmap-export: writes the generated documents to standard output. */
#include "regmap/export.h"
#include "regmap/export_st.h"

#include <errno.h>
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

/* The text of the function blocks is kept beside this file, in drivebridge.st.in. */
static int write_st(const char *path)
{
	FILE *blocks = fopen(path, "r");
	int error;

	if (!blocks) {
		perror(path);
		return EXIT_FAILURE;
	}
	error = db_export_st(stdout, blocks);
	fclose(blocks);
	if (error != 0 || fflush(stdout) != 0) {
		fprintf(stderr, "regmap-export: %s: %s\n", path, strerror(error ? -error : errno));
		return EXIT_FAILURE;
	}
	return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
	if (argc == 3 && strcmp(argv[1], "st") == 0)
		return write_st(argv[2]);
	for (size_t i = 0; argc == 2 && i < DOCUMENTS; i++) {
		if (strcmp(argv[1], documents[i].name) != 0)
			continue;
		if (documents[i].export(stdout) != 0 || fflush(stdout) != 0) {
			perror("regmap-export");
			return EXIT_FAILURE;
		}
		return EXIT_SUCCESS;
	}
	fprintf(stderr, "usage: regmap-export csv|md|commands|st TEMPLATE\n");
	return 2;
}
