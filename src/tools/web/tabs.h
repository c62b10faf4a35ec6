/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Pages that act. Each has a connection of its own to the service, so that control, watchdog and
 * history work as for any client; stops go past it (stops.h). It is closed when the page falls
 * silent, its login ends, or the service is lost; the watchdog then stops what the page moved.
 * While it is open, the watchdogs of the drives that it commanded are fed as long as they move. One
 * thread.
 */
#ifndef DRIVEBRIDGE_WEB_TABS_H
#define DRIVEBRIDGE_WEB_TABS_H

#include "client/lanes.h"
#include "web/grip.h"
#include "web/request.h"

/* Pages send a keep-alive at this interval; a page without one for DB_WEB_TAB_SILENT is gone. */
#define DB_WEB_TAB_SILENT (5 * DB_NS_PER_S)

/* The lanes of the server's pages, and of all stops. NULL without memory. */
struct db_lanes *db_web_tabs_make_lanes(struct db_web_server *server);

/* What is wrong with a page's id or the number of its call, in words; NULL: nothing. Either may be
 * NULL: it is not given. */
const char *db_web_tabs_judge(const char *tab, const char *call);

/* Carries out an acting call, and answers the request. A stop goes past everything that waits, and
 * ends the grips that move the stopped drives. */
void db_web_tabs_act(struct db_web_request *request);

/* A request that acts on this drive (NULL: on none that is to be fed) begins. The connection for
 * its first call; NULL: it has been answered with the reason why not. */
struct db_link *db_web_tabs_begin(struct db_web_request *request, const char *drive);

/* The connection for a further call; NULL: the page is gone. `why` is set if the request may not
 * act any more: for that reason, or because a stop that the page sent later has overtaken it. Valid
 * until the loop goes on. */
struct db_link *db_web_tabs_link(const struct db_web_request *request, const char *drive,
                                 const char **why);

/* A beat of the dead man's rule. */
void db_web_tabs_jog(struct db_web_request *request);

/* The same for a sequence of named positions. */
void db_web_tabs_sequence(struct db_web_request *request);

/* A keep-alive of the page. */
void db_web_tabs_keep_alive(struct db_web_request *request);

void db_web_tabs_tick(struct db_web_server *server, db_time now);

/* The tabs of a session leave, all with NULL: what their grips move is stopped, and then they are
 * closed. */
void db_web_tabs_leave(struct db_web_server *server, const char *session, enum db_web_grip_end end);

/* The service is lost: all are closed. */
void db_web_tabs_close(struct db_web_server *server);

#endif
