/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The flash of a simulated VSMD drive: "name=value name=value ...".
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_FLASH_H
#define DRIVEBRIDGE_SIM_VSMD_FLASH_H

#include "codec/vsmd.h"

/* 0 or a negative errno, as of sim_flash_write(). */
int sim_vsmd_flash_write(const char *path, const union db_value values[VSMD_PARAM_COUNT]);

/*
 * Changes those values that the file has. 0, -ENOENT when there is no file yet, -EBADMSG when its
 * content is not what sim_vsmd_flash_write() writes (values may then be partly changed), or another
 * errno.
 */
int sim_vsmd_flash_read(const char *path, union db_value values[VSMD_PARAM_COUNT]);

#endif
