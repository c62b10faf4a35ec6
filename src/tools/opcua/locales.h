/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Descriptions in the languages of po/: the library answers each session with the one that it has asked for, by the
 * LocaleIds of its ActivateSession, and else in English. One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_LOCALES_H
#define DRIVEBRIDGE_OPCUA_LOCALES_H

#include <open62541/plugin/nodestore.h>
#include <open62541/server.h>

/* What clients may ask for; de-AT gets de, too. */
#define DB_OPCUA_LOCALE_IDS 2
#define DB_OPCUA_LANGUAGES 2

struct db_words_language;

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

/* Fills in the texts, which `english` must outlive; `all`: in each language. The list, for the attribute of a node. */
UA_LocalizedTextListEntry *db_opcua_locales_fill(const struct db_opcua_locales *locales,
                                                 struct db_opcua_texts *texts, const char *english,
                                                 bool all);
/* Frees what was filled in. Texts of only zeros are allowed. */
void db_opcua_texts_clear(struct db_opcua_texts *texts);

#endif
