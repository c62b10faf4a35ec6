/* SPDX-License-Identifier: Apache-2.0 */
/* A call in varlink's wire format, from its JSON. No I/O; allocates as jansson does. */
#ifndef DRIVEBRIDGE_CONTROL_MESSAGE_H
#define DRIVEBRIDGE_CONTROL_MESSAGE_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

/* The longest message that is taken, without its end. */
#define DB_MESSAGE_MAX 32768

struct db_message {
	json_t *root;       /* owns what follows */
	const char *method; /* with its interface */
	json_t *parameters; /* null: none */
	bool more;
	bool oneway;
};

/* Null, and the message is to be cleared; else what is wrong with it, in words. */
const char *db_message_parse(const char *text, size_t length, struct db_message *message);
void db_message_clear(struct db_message *message);

/* JSON as all answers have it; to be freed, null when out of memory. Takes the value over. */
char *db_message_text(json_t *value);

/* Lines as an array of texts; one that is no UTF-8 becomes "?". */
json_t *db_message_lines(const char *lines);

/* The text of an answer, with its end; to be freed, null when out of memory. Takes the parameters over.
 * `error`: null for none. */
char *db_message_answer(const char *error, json_t *parameters, bool continues, size_t *length);

#endif
