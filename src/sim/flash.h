/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file that stands for a simulated drive's flash. What it holds is each family's own affair.
 */
#ifndef DRIVEBRIDGE_SIM_FLASH_H
#define DRIVEBRIDGE_SIM_FLASH_H

#include <stddef.h>

/* Replaces the file as one step: whoever reads sees the old or the new. 0 or a negative errno. */
int sim_flash_write(const char *path, const char *text, size_t length);

/*
 * Fills text, of `size` bytes, and ends it with a zero. The length, -ENOENT when there is no file
 * yet, -EFBIG when it is longer, or another errno.
 */
int sim_flash_read(const char *path, char *text, size_t size);

#endif
