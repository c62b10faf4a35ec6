/* SPDX-License-Identifier: Apache-2.0 */
/* A call in varlink's wire format, from its JSON. No I/O; allocates as jansson does. */
#ifndef DRIVEBRIDGE_CONTROL_MESSAGE_H
#define DRIVEBRIDGE_CONTROL_MESSAGE_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

/* The longest accepted message, without its end. */
#define DB_MESSAGE_MAX 32768

struct db_message {
	json_t *root;       /* owns what follows */
	const char *method; /* including its interface */
	json_t *parameters; /* null: none */
	bool more;
	bool oneway;
};

/* Null: the message is valid and must be cleared; else the error, in words. */
const char *db_message_parse(const char *text, size_t length, struct db_message *message);
void db_message_clear(struct db_message *message);

/* JSON in the form of all answers; to be freed, null when out of memory. Takes over the value. */
char *db_message_text(json_t *value);

/* Lines as an array of texts; a line that is not UTF-8 becomes "?". */
json_t *db_message_lines(const char *lines);

/* The text of an answer, with its end; to be freed, null when out of memory. Takes over the
 * parameters. `error`: null for none. */
char *db_message_answer(const char *error, json_t *parameters, bool continues, size_t *length);

#endif
