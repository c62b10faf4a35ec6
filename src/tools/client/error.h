/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An error of the service or of the connection to it, with a text for people.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_CLIENT_ERROR_H
#define DRIVEBRIDGE_CLIENT_ERROR_H

#include <jansson.h>
#include <stdbool.h>

#define DB_CLIENT_SERVICE "io.drivebridge.Control."

/* Errors of the client's side; those of the service have the names of its interface. */
#define DB_CLIENT_OWN "io.drivebridge.Client."
#define DB_CLIENT_UNREACHABLE "io.drivebridge.Client.Unreachable"
#define DB_CLIENT_LOST "io.drivebridge.Client.Lost"
#define DB_CLIENT_TIMEOUT "io.drivebridge.Client.Timeout"
#define DB_CLIENT_BAD_ANSWER "io.drivebridge.Client.BadAnswer"
#define DB_CLIENT_NO_MEMORY "io.drivebridge.Client.NoMemory"

struct db_client_error {
	char name[96]; /* "" when there is no error */
	/* of the service's errors, else NULL; freed with db_client_error_clear() */
	json_t *parameters;
	char text[512]; /* one sentence without a full stop */
};

void db_client_error_clear(struct db_client_error *error);

/* Replaces a former error. */
void db_client_error_set(struct db_client_error *error, const char *name, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* From an answer's `error` and `parameters` (may be NULL, stays the caller's). */
void db_client_error_read(struct db_client_error *error, const char *name, json_t *parameters);

/* The last part of an error's name: BadValue of io.drivebridge.Control.BadValue. */
const char *db_client_error_short(const struct db_client_error *error);

/* Of a command that moves: true if the drive may move although the call failed. After a refusal
 * there is nothing to stop, and another client's motion must not be stopped. */
bool db_client_error_may_move(const struct db_client_error *error);

#endif
