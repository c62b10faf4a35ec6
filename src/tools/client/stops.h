/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stops, past everything that waits: each over a connection of its own. The service takes the next
 * call of a connection after the answer to the one before, and a stop is answered when the drive
 * has confirmed it, which a silent drive never does: so no stop waits for another.
 *
 * When all places are taken, the oldest stop gives its place to the next one: the service continues
 * it by itself. When the service has no room for a further connection, the stop goes over one that
 * is kept open for that, without an answer. One thread.
 */
#ifndef DRIVEBRIDGE_CLIENT_STOPS_H
#define DRIVEBRIDGE_CLIENT_STOPS_H

#include "client/link.h"

struct db_stops;

/* The error of a stop that was sent and continues, and whose end will not be known. */
#define DB_STOPS_PENDING "io.drivebridge.Client.Pending"

/* For this number of stops without an answer. The path must outlive it. NULL without memory;
 * freed with free(), after db_stops_drop(). */
struct db_stops *db_stops_new(sd_event *loop, const char *path, size_t places);

/* Opens the connection for stops without an answer, if it is not open: while the service is there
 * and has room. */
void db_stops_prepare(struct db_stops *stops);

/* For whom a stop is, as for db_link_introduce(). */
struct db_stops_user {
	const char *name;
	const char *from;
};

/*
 * Sends a call that stops, as db_link_send() for this user; the answer may arrive before this
 * returns. A former stop with the same key (NULL: none) gives its place to it. False: nothing was
 * sent, and there will be no answer; the service is away.
 */
bool db_stops_send(struct db_stops *stops, const char *key, const struct db_stops_user *user,
                   const char *method, json_t *parameters, bool more, db_client_answer_fn *answer,
                   void *data);

/* The receiver of these answers no longer exists. */
void db_stops_forget(struct db_stops *stops, const void *data);

/* The connection over which an answer to this receiver is awaited; NULL: none. */
struct db_link *db_stops_link(const struct db_stops *stops, const void *data);

/* Closes all connections; waiting stops are answered with DB_CLIENT_LOST. True if there were any.
 */
bool db_stops_drop(struct db_stops *stops);

#endif
