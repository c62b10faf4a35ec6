/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_private.h"

#include "codec/vsmd_can.h"
#include "codec/vsmd_numbers.h"

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

/* --- VSMD drives ------------------------------------------------------------------------------ */

int sim_vsmd_flash_write(const char *path, const union db_value values[VSMD_PARAM_COUNT])
{
	char text[VSMD_SERIAL_FRAME_MAX];
	size_t length = 0;

	for (size_t i = 0; i < VSMD_PARAM_COUNT; i++) {
		char value[64];
		int written = vsmd_format_value(vsmd_params[i].type, values[i], value,
		                                sizeof(value));

		if (written < 0)
			return -EBADMSG;
		written = snprintf(text + length, sizeof(text) - length, "%s=%s%c",
		                   vsmd_params[i].name, value,
		                   i + 1 < VSMD_PARAM_COUNT ? ' ' : '\n');
		if (written < 0 || (size_t)written >= sizeof(text) - length)
			return -EMSGSIZE;
		length += (size_t)written;
	}
	return sim_flash_write(path, text, length);
}

int sim_vsmd_flash_read(const char *path, union db_value values[VSMD_PARAM_COUNT])
{
	char text[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_setting setting;
	size_t cursor = 0;
	int length = sim_flash_read(path, text, sizeof(text));
	int found;

	if (length < 0)
		return length;
	if (length == 0 || text[length - 1] != '\n')
		return -EBADMSG;
	length--;
	while ((found = vsmd_serial_next_param(text, (size_t)length, &cursor, &setting)) != 0) {
		if (found != 1 || !(vsmd_param_in_range(setting.param, setting.value) ||
		                    vsmd_can_param_in_range(setting.param, setting.value)))
			return -EBADMSG;
		values[setting.param] = setting.value;
	}
	return 0;
}
