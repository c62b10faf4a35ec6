/* SPDX-License-Identifier: Apache-2.0 */
/* A Unix socket at a path. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_LISTENER_H
#define DRIVEBRIDGE_CONTROL_LISTENER_H

/* Listens there, for everybody: who may do what is asked of each connection. What a process that was killed
 * has left is replaced, a socket at which somebody answers is not. The descriptor; or -1, and *why in words. */
int db_control_listener_open(const char *path, const char **why);

#endif
