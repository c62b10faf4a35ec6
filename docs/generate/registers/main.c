/* SPDX-License-Identifier: Apache-2.0 */
/* regmap-export: writes the generated documents to standard output. */
#include "registers/export.h"
#include "registers/export_st.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static const struct {
	const char *name;
	int (*export)(FILE *out);
} documents[] = {
	{ "csv", db_export_csv },
	{ "md", db_export_markdown },
	{ "commands", db_export_commands },
	{ "events", db_export_events },
};

#define DOCUMENTS (sizeof documents / sizeof documents[0])

/* The library's text in its order: a file of the folder drivebridge.st.in for each block, and what
 * all of them use before them. */
static const char *const blocks[] = {
	"head",
	"types",
	"values",
	"DB_ModbusClient",
	"DB_Share",
	"DB_Exchange",
	"DB_Axis",
	"DB_Command",
	"DB_Motion",
	"DB_Counts",
	"MC_Power",
	"MC_Stop",
	"MC_Halt",
	"MC_MoveAbsolute",
	"MC_MoveRelative",
	"MC_MoveVelocity",
	"MC_Home",
	"MC_SetPosition",
	"MC_Reset",
	"MC_ReadStatus",
	"MC_ReadParameter",
	"MC_WriteParameter",
};

#define BLOCKS (sizeof blocks / sizeof blocks[0])

static int fail(const char *path, int error)
{
	fprintf(stderr, "regmap-export: %s: %s\n", path, strerror(error));
	return EXIT_FAILURE;
}

static int is_block(const struct dirent *entry)
{
	const char *dot = strrchr(entry->d_name, '.');

	return dot && strcmp(dot, ".st") == 0;
}

/* A file that is not in the list would be left out without a word. */
static bool is_complete(const char *folder)
{
	struct dirent **entries = NULL;
	int found = scandir(folder, &entries, is_block, NULL);

	for (int i = 0; i < found; i++)
		free(entries[i]);
	free(entries);
	return found == (int)BLOCKS;
}

/* One behind the other, with an empty line between. */
static int write_st(const char *folder)
{
	FILE *all = tmpfile();
	int error;

	if (!all)
		return fail("a temporary file", errno);
	if (!is_complete(folder)) {
		fprintf(stderr, "regmap-export: %s: not just the %zu blocks of the list\n", folder,
		        BLOCKS);
		fclose(all);
		return EXIT_FAILURE;
	}
	for (size_t i = 0; i < BLOCKS; i++) {
		char path[PATH_MAX];
		FILE *block;
		int byte;

		snprintf(path, sizeof path, "%s/%s.st", folder, blocks[i]);
		block = fopen(path, "r");
		if (!block) {
			error = errno;
			fclose(all);
			return fail(path, error);
		}
		if (i > 0)
			putc('\n', all);
		while ((byte = getc(block)) != EOF)
			putc(byte, all);
		fclose(block);
	}
	error = fseek(all, 0, SEEK_SET) == 0 ? db_export_st(stdout, all) : -errno;
	fclose(all);
	if (error != 0 || fflush(stdout) != 0)
		return fail(folder, error ? -error : errno);
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
	fprintf(stderr, "usage: regmap-export csv|md|commands|events|st FOLDER\n");
	return 2;
}
