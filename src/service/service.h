/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The life of the service: buses, registers and server put together, the network thread's loop,
 * reloads and an end in order.
 */
#ifndef DRIVEBRIDGE_SERVICE_SERVICE_H
#define DRIVEBRIDGE_SERVICE_SERVICE_H

#include "drivebridge/config.h"

/*
 * Runs until SIGTERM or SIGINT; SIGHUP loads the file at `path` again. Takes the configuration
 * over. Blocks these signals for good, before any thread starts. The status to exit with.
 */
int db_service_run(struct db_config *config, const char *path);

#endif
