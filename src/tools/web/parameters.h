/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parameters for pages, with the sets, files and the order of writing that drivebridgectl has, too
 * (params/): the file of a drive, the values in a file, and writing them into a drive while a
 * stream reports each. Writing uses the connection of the page, ends with its stream, with any stop
 * that the page sends, and when the page is gone. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_PARAMETERS_H
#define DRIVEBRIDGE_WEB_PARAMETERS_H

#include "web/request.h"

/* Serves a request, by its kind. */
void db_web_parameters_take(struct db_web_request *request);

/* After the pages' tick: watchdogs are fed when nothing waits on a page's connection. */
void db_web_parameters_tick(struct db_web_server *server, db_time now);

/* After all connections to the service are closed. */
void db_web_parameters_free(struct db_web_server *server);

#endif
