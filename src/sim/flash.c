/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_private.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <unistd.h>

int sim_flash_write(const char *path, const char *text, size_t length)
{
	char temporary[PATH_MAX];
	int named = snprintf(temporary, sizeof(temporary), "%s.new", path);
	FILE *file;
	int result = 0;

	if (named < 0 || (size_t)named >= sizeof(temporary))
		return -ENAMETOOLONG;
	file = fopen(temporary, "we");
	if (!file)
		return -errno;
	if (fwrite(text, 1, length, file) != length)
		result = -EIO;
	if (fclose(file) != 0 && result == 0)
		result = -errno;
	if (result == 0 && rename(temporary, path) != 0)
		result = -errno;
	if (result != 0)
		(void)unlink(temporary);
	return result;
}

int sim_flash_read(const char *path, char *text, size_t size)
{
	FILE *file = fopen(path, "re");
	int result;

	if (!file)
		return -errno;
	errno = 0;
	result = (int)fread(text, 1, size, file);
	if (ferror(file))
		result = errno ? -errno : -EIO;
	else if ((size_t)result == size)
		result = -EFBIG;
	else
		text[result] = '\0';
	(void)fclose(file);
	return result;
}
