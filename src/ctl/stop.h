/* SPDX-License-Identifier: Apache-2.0 */
/* Stopping a drive when something went wrong with the connection that moves it, or when that waits. */
#ifndef DRIVEBRIDGE_CTL_STOP_H
#define DRIVEBRIDGE_CTL_STOP_H

#include "ctl/session.h"

/* Over a connection of its own. 0, or -1 with the error: then only its watchdog is left. */
int db_ctl_stop_drive(const struct db_ctl *ctl, const char *drive, struct db_client_error *error);

#endif
