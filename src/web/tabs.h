/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Pages that act. Each has a connection of its own to the service, so that control, watchdog and history are as for any
 * client, and a second one for stops, which must not wait for anything. Both are closed when the page falls silent, its
 * login ends, or the service goes; what it moved is then stopped by the watchdog. While it is there, the drives that it
 * commanded hear of it as long as they move. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_TABS_H
#define DRIVEBRIDGE_WEB_TABS_H

#include "web/request.h"

/* A page says so often that it is there; one that says nothing for DB_WEB_TAB_SILENT is gone. */
#define DB_WEB_TAB_SILENT (5 * DB_NS_PER_S)

/* Whether it can be a page's id. */
bool db_web_tab_is_good(const char *id);

/* Carries a call out that acts, and answers the request. */
void db_web_tabs_act(struct db_web_request *request);

/* The page says that it is there. */
void db_web_tabs_hear(struct db_web_request *request);

void db_web_tabs_tick(struct db_web_server *server, db_time now);

/* Closes those of a session; all with NULL. */
void db_web_tabs_close(struct db_web_server *server, const char *session);

#endif
