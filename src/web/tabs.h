/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Pages that act. Each has a connection of its own to the service, so that control, watchdog and history are as for any
 * client; stops go past it (stops.h). It is closed when the page falls silent, its login ends, or the service goes; what it
 * moved is then stopped by the watchdog. While it is there, the drives that it commanded hear of it as long as they
 * move. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_TABS_H
#define DRIVEBRIDGE_WEB_TABS_H

#include "web/grip.h"
#include "web/request.h"

/* A page says so often that it is there; one that says nothing for DB_WEB_TAB_SILENT is gone. */
#define DB_WEB_TAB_SILENT (5 * DB_NS_PER_S)

/* Whether it can be a page's id. */
bool db_web_tab_is_good(const char *id);

/* The number of a call in its digits. False: it is none, and stays as it was. */
bool db_web_call_number_read(const char *text, uint64_t *number);

/* Carries a call out that acts, and answers the request. A stop goes past everything that waits, and ends the grips that
 * move what it stops. */
void db_web_tabs_act(struct db_web_request *request);

/* A beat of the dead man's rule. */
void db_web_tabs_jog(struct db_web_request *request);

/* The page says that it is there. */
void db_web_tabs_hear(struct db_web_request *request);

void db_web_tabs_tick(struct db_web_server *server, db_time now);

/* Those of a session leave, all with NULL: what their grips move is stopped, and then they are closed. */
void db_web_tabs_leave(struct db_web_server *server, const char *session, enum db_web_grip_end end);

/* The service is gone: all are closed. */
void db_web_tabs_close(struct db_web_server *server);

#endif
