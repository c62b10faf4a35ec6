/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control socket: a UNIX stream socket that takes the lines of commands.h.
 */
#ifndef DRIVEBRIDGE_SIM_CONTROL_H
#define DRIVEBRIDGE_SIM_CONTROL_H

#include "sim/world.h"

#define SIM_CONTROL_CLIENTS 16

struct sim_control;

/* Listens at path; an old socket there is replaced. The world must outlive it. 0 or a negative
 * errno. */
int sim_control_open(const char *path, struct sim_world *world, struct sim_control **control);
void sim_control_close(struct sim_control *control);

/* One descriptor to wait on for everything here (an epoll set). */
int sim_control_fd(const struct sim_control *control);

/* Serves all ready clients. */
void sim_control_run(struct sim_control *control, db_time now);

#endif
