/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The life of the service: buses, registers and server put together, the network thread's loop,
 * reloads and an end in order.
 */
#ifndef DRIVEBRIDGE_SERVICE_SERVICE_H
#define DRIVEBRIDGE_SERVICE_SERVICE_H

#include <stdbool.h>

/*
 * Runs with the configuration at `path` until SIGTERM or SIGINT; SIGHUP loads it again. When it is wrong and `last_good`
 * says so, with the one that was in force last, which is kept in systemd's StateDirectory. Blocks these signals for good,
 * before any thread starts. The status to exit with; EX_CONFIG: it is wrong, and nothing ran.
 */
int db_service_run(const char *path, bool last_good);

#endif
