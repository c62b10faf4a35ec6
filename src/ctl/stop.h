/* SPDX-License-Identifier: Apache-2.0 */
/* Stopping drives: by command, and when something went wrong with the connection that moves one, or when that waits. */
#ifndef DRIVEBRIDGE_CTL_STOP_H
#define DRIVEBRIDGE_CTL_STOP_H

#include "ctl/commands.h"

/* The command `stop`. It needs no connection that is open already, and asks for nothing before it stops. */
enum db_ctl_status db_ctl_stop(struct db_ctl *ctl, int count, char **arguments);

/* Over a connection of its own. 0, or -1 with the error: then only its watchdog is left. */
int db_ctl_stop_drive(const struct db_ctl *ctl, const char *drive, struct db_client_error *error);

#endif
