/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A connection to the control socket in the loop. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_LINK_H
#define DRIVEBRIDGE_WEB_LINK_H

#include "client/client.h"

#include <systemd/sd-event.h>

struct db_web_link;

/* It is lost, and every call has been answered with that; to be closed. */
typedef void db_web_link_lost_fn(void *data);

/* NULL with an error. Closed with db_web_link_close(). */
struct db_web_link *db_web_link_open(sd_event *loop, const char *path, db_web_link_lost_fn *lost,
                                     void *data, struct db_client_error *error);

/* Calls that wait are answered with DB_CLIENT_LOST before this returns. May be called from answers, and from `lost`. NULL
 * is allowed. */
void db_web_link_close(struct db_web_link *link);

/* As db_client_send(). */
int db_web_link_send(struct db_web_link *link, const char *method, json_t *parameters, bool more,
                     db_client_answer_fn *answer, void *data);

/* As db_client_tell(): without an answer, and nothing waits behind it. */
int db_web_link_tell(struct db_web_link *link, const char *method, json_t *parameters);

/* What it is told from now on is this user's, "": nobody's; the service's history names him. */
void db_web_link_introduce(struct db_web_link *link, const char *user);

/* Calls that have not been answered for the last time. */
unsigned db_web_link_waiting(const struct db_web_link *link);

/* Whether answers stay where they are: the service sees a reader that is slow. */
void db_web_link_hold(struct db_web_link *link, bool hold);

#endif
