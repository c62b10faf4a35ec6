/* SPDX-License-Identifier: Apache-2.0 */
/*
 * In place of libFuzzer: runs a fuzz target once with each file, or each file of a folder. For builds
 * that measure coverage, and for debuggers and valgrind.
 */
#include <dirent.h>
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#define SIZE_MAX_OF_INPUT (1 << 20)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int run_file(const char *path)
{
	static uint8_t bytes[SIZE_MAX_OF_INPUT];
	FILE *file = fopen(path, "rb");
	size_t size;

	if (!file) {
		perror(path);
		return -1;
	}
	size = fread(bytes, 1, sizeof bytes, file);
	(void)fclose(file);
	return LLVMFuzzerTestOneInput(bytes, size);
}

static int run_folder(const char *path)
{
	char name[PATH_MAX];
	struct dirent *entry;
	DIR *folder = opendir(path);
	int result = 0;

	if (!folder) {
		perror(path);
		return -1;
	}
	while (result == 0 && (entry = readdir(folder)) != NULL) {
		if (entry->d_name[0] == '.')
			continue;
		(void)snprintf(name, sizeof name, "%s/%s", path, entry->d_name);
		result = run_file(name);
	}
	(void)closedir(folder);
	return result;
}

int main(int argc, char **argv)
{
	struct stat status;
	int result = 0;

	for (int i = 1; result == 0 && i < argc; i++) {
		bool folder = stat(argv[i], &status) == 0 && S_ISDIR(status.st_mode);

		result = folder ? run_folder(argv[i]) : run_file(argv[i]);
	}
	return result == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
