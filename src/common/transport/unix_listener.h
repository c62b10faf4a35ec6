/* SPDX-License-Identifier: Apache-2.0 */
/* A Unix socket at a path, for other programs of this machine. */
#ifndef DRIVEBRIDGE_TRANSPORT_UNIX_LISTENER_H
#define DRIVEBRIDGE_TRANSPORT_UNIX_LISTENER_H

/* Listens there, for everybody: rights are checked for each connection. A socket left by a killed
 * process is replaced, one at which a process listens is not. The non-blocking descriptor; or -1,
 * and *why in words. */
int db_unix_listener_open(const char *path, const char **why);

#endif
