/* SPDX-License-Identifier: Apache-2.0 */
/* The server of the page: a daemon of libmicrohttpd without threads in an sd-event loop. One thread, beside the hasher's. */
#ifndef DRIVEBRIDGE_WEB_SERVER_H
#define DRIVEBRIDGE_WEB_SERVER_H

#include "web/config.h"

/* Serves until SIGTERM or SIGINT, which are blocked. The status to exit with. */
int db_web_serve(const struct db_web_config *config);

#endif
