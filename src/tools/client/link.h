/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A connection to the control socket (client.h) in an sd-event loop: answers arrive while the loop
 * runs. Any function may be called from an answer, closing the link itself among them. One thread.
 */
#ifndef DRIVEBRIDGE_CLIENT_LINK_H
#define DRIVEBRIDGE_CLIENT_LINK_H

#include "client/client.h"

#include <systemd/sd-event.h>

struct db_link;

/* The connection is lost, and every call has been answered with that; to be closed. */
typedef void db_link_lost_fn(void *data);

/* NULL with an error. Closed with db_link_close() or db_link_drop(). `lost` may be NULL, where
 * the calls' answers are enough. */
struct db_link *db_link_open(sd_event *loop, const char *path, db_link_lost_fn *lost, void *data,
                             struct db_client_error *error);

/* Waiting calls are answered with DB_CLIENT_LOST before this returns. NULL is allowed. */
void db_link_close(struct db_link *link);

/* The same without these answers. */
void db_link_drop(struct db_link *link);

/* As db_client_send(). */
int db_link_send(struct db_link *link, const char *method, json_t *parameters, bool more,
                 db_client_answer_fn *answer, void *data);

/* As db_client_tell(): without an answer, so no other call waits for it. */
int db_link_tell(struct db_link *link, const char *method, json_t *parameters);

#define DB_LINK_USER_MAX 32 /* bytes */

#define DB_LINK_FROM_MAX 64 /* bytes */

/* From now on its calls are this user's, "": nobody's; the service's history has the name. `from`:
 * where the user is, for the audit trail; "": not known, or the service is one of before. Nothing
 * is sent when they are already. `answer` may be NULL. */
void db_link_introduce(struct db_link *link, const char *user, const char *from,
                       db_client_answer_fn *answer, void *data);

/* The one introduced last; "" at first. */
const char *db_link_user(const struct db_link *link);

/* The same as db_link_introduce(), without an answer that a later call would wait for. */
void db_link_introduce_now(struct db_link *link, const char *user, const char *from);

/* Calls whose last answer has not arrived. */
unsigned db_link_waiting(const struct db_link *link);

/* True: answers are not read, so that the service sees a slow reader. */
void db_link_hold(struct db_link *link, bool hold);

/* For a caller that has to wait while the loop does not run: as db_client_poll_fd(), and reading
 * what has arrived. */
struct pollfd db_link_poll_fd(const struct db_link *link);
void db_link_handle(struct db_link *link);

#endif
