/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One configuration is run by one process: two would be two masters on every bus it names. Serial
 * ports are locked one by one, CAN interfaces cannot be. Internal to src/service.
 */
#ifndef DRIVEBRIDGE_SERVICE_ALONE_H
#define DRIVEBRIDGE_SERVICE_ALONE_H

#include <sys/types.h>

/*
 * Takes the configuration at this path for this process, as long as the descriptor that is returned
 * stays open. -EBUSY when another process of this user or of root has it, *holder then is its id,
 * or 0 when that cannot be told; or another negative errno.
 */
int alone_take(const char *path, pid_t *holder);

#endif
