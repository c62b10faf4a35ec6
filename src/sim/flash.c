/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/flash.h"

#include "codec/vsmd_can.h"
#include "codec/vsmd_serial.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static int write_values(FILE *file, const union db_value values[VSMD_PARAM_COUNT])
{
	for (size_t i = 0; i < VSMD_PARAM_COUNT; i++) {
		char text[64];
		int length = vsmd_format_value(vsmd_params[i].type, values[i], text, sizeof(text));

		if (length < 0)
			return -EBADMSG;
		if (fprintf(file, "%s%s=%s", i ? " " : "", vsmd_params[i].name, text) < 0)
			return -EIO;
	}
	return fputc('\n', file) == EOF ? -EIO : 0;
}

int sim_flash_write(const char *path, const union db_value values[VSMD_PARAM_COUNT])
{
	char temporary[PATH_MAX];
	int length = snprintf(temporary, sizeof(temporary), "%s.new", path);
	FILE *file;
	int result;

	if (length < 0 || (size_t)length >= sizeof(temporary))
		return -ENAMETOOLONG;
	file = fopen(temporary, "we");
	if (!file)
		return -errno;
	result = write_values(file, values);
	if (fclose(file) != 0 && result == 0)
		result = -errno;
	if (result == 0 && rename(temporary, path) != 0)
		result = -errno;
	if (result != 0)
		(void)unlink(temporary);
	return result;
}

int sim_flash_read(const char *path, union db_value values[VSMD_PARAM_COUNT])
{
	char text[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_setting setting;
	size_t cursor = 0;
	size_t length;
	int found;
	FILE *file = fopen(path, "re");

	if (!file)
		return -errno;
	length = fread(text, 1, sizeof(text), file);
	(void)fclose(file);
	if (length == 0 || text[length - 1] != '\n')
		return -EBADMSG;
	length--;
	while ((found = vsmd_serial_next_param(text, length, &cursor, &setting)) != 0) {
		if (found != 1 || !(vsmd_param_in_range(setting.param, setting.value) ||
		                    vsmd_can_param_in_range(setting.param, setting.value)))
			return -EBADMSG;
		values[setting.param] = setting.value;
	}
	return 0;
}
