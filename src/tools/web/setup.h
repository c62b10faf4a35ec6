/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Pages that give a drive another address or speed (setup/move.h): a stream says what is done and
 * asks, and calls answer. It ends with its stream, after any error, and when the page is gone. One
 * thread.
 */
#ifndef DRIVEBRIDGE_WEB_SETUP_H
#define DRIVEBRIDGE_WEB_SETUP_H

#include "web/request.h"

/* Answers with the stream of a new one. */
void db_web_setup_begin(struct db_web_request *request);

/* The user's answer to its question, or his wish to end it. */
void db_web_setup_hear(struct db_web_request *request);

void db_web_setup_tick(struct db_web_server *server, db_time now);

/* After all connections to the service are closed. */
void db_web_setup_free(struct db_web_server *server);

#endif
