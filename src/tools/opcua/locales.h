/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Texts in the languages of po/, for each session in the one that it has asked for by the LocaleIds
 * of its ActivateSession, else in English. Of descriptions and display names the library gets a
 * list, and chooses from it; values that are texts are asked for with the session. One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_LOCALES_H
#define DRIVEBRIDGE_OPCUA_LOCALES_H

#include "words/language.h"

#include <open62541/plugin/nodestore.h>
#include <open62541/server.h>

/* What clients may ask for; de-AT gets de, too. */
#define DB_OPCUA_LOCALE_IDS 2
#define DB_OPCUA_LANGUAGES 2

struct db_opcua_locales {
	struct db_words_language *languages[DB_OPCUA_LANGUAGES]; /* null: not installed */
};

/* The texts of one attribute, the English one last. */
struct db_opcua_texts {
	UA_LocalizedTextListEntry entries[1 + DB_OPCUA_LOCALE_IDS];
	char *translations[DB_OPCUA_LANGUAGES];
};

/* Opens what is installed in `folder`, such as /usr/share/locale. */
void db_opcua_locales_open(struct db_opcua_locales *locales, const char *folder);
void db_opcua_locales_close(struct db_opcua_locales *locales);

/* Says in the server's capabilities which ids it has texts for. */
UA_StatusCode db_opcua_locales_tell(const struct db_opcua_locales *locales, UA_Server *server);

/* Fills in the texts, which `english` must outlive; `all`: in each language. The list, for the
 * attribute of a node. */
UA_LocalizedTextListEntry *db_opcua_locales_fill(const struct db_opcua_locales *locales,
                                                 struct db_opcua_texts *texts, const char *english,
                                                 bool all);
/* Fills in the same list for a name that is shown: `name` in English, and in other languages the
 * words of the table for `key` of this length, such as "axis_state"; NULL: there are none. */
UA_LocalizedTextListEntry *db_opcua_locales_fill_name(
	const struct db_opcua_locales *locales,
	UA_LocalizedTextListEntry entries[1 + DB_OPCUA_LOCALE_IDS], UA_String name, const char *key,
	size_t length);

/*
 * A finished English text as this session has asked for it; in English where it has asked for none
 * of the languages, and where there is no session. What is returned is `room`, `english` or the
 * locales' own.
 */
UA_LocalizedText db_opcua_locales_say(const struct db_opcua_locales *locales, UA_Server *server,
                                      const UA_NodeId *session, const char *english,
                                      char room[DB_WORDS_TEXT_MAX]);

/* The same of a name, such as "no_answer"; as it is where the language has no words for it. */
UA_LocalizedText db_opcua_locales_say_name(const struct db_opcua_locales *locales,
                                           UA_Server *server, const UA_NodeId *session,
                                           UA_String name);

/* Frees what was filled in. Texts of only zeros are allowed. */
void db_opcua_texts_clear(struct db_opcua_texts *texts);

#endif
