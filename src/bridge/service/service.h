/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The life of the service: buses, registers and server put together, the network thread's loop,
 * reloads and an end in order.
 */
#ifndef DRIVEBRIDGE_SERVICE_SERVICE_H
#define DRIVEBRIDGE_SERVICE_SERVICE_H

#include <stdbool.h>

/*
 * Runs with the configuration at `path` until SIGTERM or SIGINT; SIGHUP loads it again. When it is
 * invalid and `last_good` is set, runs with the one that was in force last, which is stored in
 * systemd's StateDirectory. Blocks these signals for good, before any thread starts. Returns the
 * exit status; EX_CONFIG: it is invalid, and nothing ran.
 */
int db_service_run(const char *path, bool last_good);

#endif
