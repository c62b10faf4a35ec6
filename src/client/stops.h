/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which commands stop a drive, for tools that must know it before they have asked: a stop is passed on however full or
 * late everything else is. The service says the same of each command in its answer to Commands (`stops`); a test holds
 * both against each other. Constant and pure; any thread.
 */
#ifndef DRIVEBRIDGE_CLIENT_STOPS_H
#define DRIVEBRIDGE_CLIENT_STOPS_H

#include <stdbool.h>

/* Their names; the last one is null. */
extern const char *const db_client_stops[];

bool db_client_is_stop(const char *command);

#endif
