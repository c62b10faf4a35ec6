/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is wrong, as the service reports it (its method Troubles): the latest record of each drive
 * and bus, and that of the configuration. Every display shows these records and decides nothing
 * itself. Allocates as jansson does.
 */
#ifndef DRIVEBRIDGE_CLIENT_TROUBLES_H
#define DRIVEBRIDGE_CLIENT_TROUBLES_H

#include "client/error.h"

#include <jansson.h>
#include <stdbool.h>

/* All 0 at first: nothing was received. */
struct db_client_troubles {
	json_t *drives;        /* records by name */
	json_t *buses;         /* also by name */
	json_t *configuration; /* null: the service reports none */
	bool told;
	bool well; /* after an answer: nobody has to look or act */
};

/* Adds an answer: the first one, or one with changes. */
void db_client_troubles_take(struct db_client_troubles *troubles, json_t *answer);
/* Forgets all: the service is gone or was restarted. */
void db_client_troubles_clear(struct db_client_troubles *troubles);

/* True when this error means that the service, from before an upgrade, does not have the method. */
bool db_client_troubles_are_missing(const struct db_client_error *error);

/* In order of urgency; hints do not count as trouble. */
enum db_client_need { DB_CLIENT_FINE, DB_CLIENT_HINT, DB_CLIENT_LOOK, DB_CLIENT_ACT };

extern const char *const db_client_needs[]; /* "nothing" ... */

/* What a record asks for; a word that only a newer service knows counts as act. A null record:
 * nothing. */
enum db_client_need db_client_trouble_need(const json_t *record);

/* What is wrong in a few words: the name of a fault, the system's error of a port; "" where nothing
 * is. */
#define DB_CLIENT_TROUBLE_WORDS_MAX 160
void db_client_trouble_words(const json_t *record, char text[DB_CLIENT_TROUBLE_WORDS_MAX]);

#endif
