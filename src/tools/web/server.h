/* SPDX-License-Identifier: Apache-2.0 */
/* The server of the page: a daemon of libmicrohttpd without threads in an sd-event loop. One
 * thread, in addition to the hasher's. */
#ifndef DRIVEBRIDGE_WEB_SERVER_H
#define DRIVEBRIDGE_WEB_SERVER_H

#include <systemd/sd-event.h>

/* Serves with a struct db_web_config until SIGTERM or SIGINT, which are blocked. Returns the exit
 * status. */
int db_web_serve(const void *config, sd_event *loop);

#endif
