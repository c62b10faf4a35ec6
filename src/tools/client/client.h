/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A connection to the control socket of drivebridged (docs/io.drivebridge.Control.varlink). The
 * service answers the calls of one connection in their order: a client that has to send something
 * while a call waits needs a second connection.
 *
 * Either each call is waited for (db_client_call()), or the owner of a loop polls
 * db_client_poll_fd() and calls db_client_handle(); both may be mixed. One thread at a time.
 */
#ifndef DRIVEBRIDGE_CLIENT_CLIENT_H
#define DRIVEBRIDGE_CLIENT_CLIENT_H

#include "client/error.h"

#include <jansson.h>
#include <poll.h>
#include <stdbool.h>

struct db_client;

/*
 * An answer: its parameters, or an error (then `parameters` is NULL). Both belong to the library.
 * With `more` further answers to this call follow. When the connection is lost, each waiting call
 * gets DB_CLIENT_LOST, or the service's Busy if it had no room for the session. May make calls,
 * must not close.
 */
typedef void db_client_answer_fn(void *data, json_t *parameters,
                                 const struct db_client_error *error, bool more);

/* 0, or -1: DB_CLIENT_UNREACHABLE with advice, or the service's Busy when too many connections
 * wait. Closed with db_client_close(). */
int db_client_open(const char *path, struct db_client **client, struct db_client_error *error);

/* Waiting calls are dropped without an answer. NULL is allowed. */
void db_client_close(struct db_client *client);

/* For poll(): POLLIN, and POLLOUT while bytes are left to send. */
struct pollfd db_client_poll_fd(const struct db_client *client);

/* Calls whose last answer has not arrived. */
unsigned db_client_waiting(const struct db_client *client);

/*
 * Makes a call; `method` is a full name, or without the interface for the service's own methods.
 * Takes `parameters` over (may be NULL). With `more` the answers are a stream. `answer` may be
 * NULL. 0, or -1 when the connection is lost or there is no memory: then there will be no answer.
 */
int db_client_send(struct db_client *client, const char *method, json_t *parameters, bool more,
                   db_client_answer_fn *answer, void *data);

/* The same without an answer: the service continues with the next call at once. */
int db_client_tell(struct db_client *client, const char *method, json_t *parameters);

/* Sends and reads as much as possible without waiting, and hands over answers. 0, or -1: the
 * connection is lost. */
int db_client_handle(struct db_client *client);

/*
 * Makes a call and waits for it. Takes `parameters` over. 0 with the answer's parameters, which the
 * caller frees, or -1 with an error. After a time-out the connection can still be used.
 */
int db_client_call(struct db_client *client, const char *method, json_t *parameters, int timeout_ms,
                   json_t **answer, struct db_client_error *error);

#endif
