/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Small parts of the simulator: the flash of drives, numbers in a text, the control socket.
 */
#ifndef DRIVEBRIDGE_SIM_SIM_PRIVATE_H
#define DRIVEBRIDGE_SIM_SIM_PRIVATE_H

#include "codec/vsmd.h"
#include "sim/world.h"

#include <stdbool.h>
#include <stddef.h>

/* --- flash.c ---------------------------------------------------------------------------------- */

/* The file in place of a simulated drive's flash. Each family defines its content. */

/* Replaces the file atomically: a reader sees the old or the new content. 0 or a negative errno. */
int sim_flash_write(const char *path, const char *text, size_t length);

/*
 * Fills `text`, of `size` bytes, with a terminating zero. The length, -ENOENT when there is no file
 * yet, -EFBIG when it is too long, or another errno.
 */
int sim_flash_read(const char *path, char *text, size_t size);

/* The flash of a simulated VSMD drive: "name=value name=value ...". */

/* 0 or a negative errno, as from sim_flash_write(). */
int sim_vsmd_flash_write(const char *path, const union db_value values[VSMD_PARAM_COUNT]);

/*
 * Changes the values that the file has. 0, -ENOENT when there is no file yet, -EBADMSG when its
 * content is not in the form of sim_vsmd_flash_write() (values may then be partly changed), or
 * another errno.
 */
int sim_vsmd_flash_read(const char *path, union db_value values[VSMD_PARAM_COUNT]);

/* --- numbers.c -------------------------------------------------------------------------------- */

/* Numbers in a text. Pure. */

/* Exactly this number of numbers from 0 to max; false for another text. */
bool sim_read_numbers(const char *text, long *numbers, size_t count, long max);

/* --- control.c -------------------------------------------------------------------------------- */

/* The control socket: a UNIX stream socket that takes the lines of commands.h. */

#define SIM_CONTROL_CLIENTS 16

struct sim_control;

/* Listens at path; an old socket there is replaced. The world must outlive it. Returns one
 * descriptor to wait on for everything here (an epoll set), or a negative errno. */
int sim_control_open(const char *path, struct sim_world *world, struct sim_control **control);
void sim_control_close(struct sim_control *control);

/* Serves all ready clients. */
void sim_control_run(struct sim_control *control, db_time now);

#endif
