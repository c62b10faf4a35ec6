/* SPDX-License-Identifier: Apache-2.0 */
/*
 * In place of libFuzzer: runs a fuzz target once with each file, or each file of a folder, which must
 * not be empty. For the seeds in every run of the tests, for coverage, debuggers and valgrind.
 */
#include <dirent.h>
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int run_file(const char *path)
{
	FILE *file = fopen(path, "rb");
	struct stat status;
	uint8_t *bytes = NULL;
	int result = -1;

	if (!file || fstat(fileno(file), &status) != 0)
		goto done;
	/* As large as the input and no larger: address sanitizer sees who reads behind it. */
	bytes = malloc(status.st_size > 0 ? (size_t)status.st_size : 1);
	if (!bytes || fread(bytes, 1, (size_t)status.st_size, file) != (size_t)status.st_size)
		goto done;
	result = LLVMFuzzerTestOneInput(bytes, (size_t)status.st_size);

done:
	if (result != 0)
		perror(path);
	free(bytes);
	if (file)
		(void)fclose(file);
	return result;
}

static int run_folder(const char *path)
{
	char name[PATH_MAX];
	struct dirent *entry;
	DIR *folder = opendir(path);
	unsigned count = 0;
	int result = 0;

	if (!folder) {
		perror(path);
		return -1;
	}
	while (result == 0 && (entry = readdir(folder)) != NULL) {
		if (entry->d_name[0] == '.')
			continue;
		(void)snprintf(name, sizeof(name), "%s/%s", path, entry->d_name);
		result = run_file(name);
		count++;
	}
	(void)closedir(folder);
	printf("%s: %u files\n", path, count);
	return count > 0 ? result : -1;
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
