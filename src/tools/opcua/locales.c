/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/locales.h"
#include "opcua/values.h"
#include "words/language.h"

#include <stdlib.h>
#include <string.h>

static const char *const names[DB_OPCUA_LANGUAGES] = { "de", "zh_CN" };

static const struct {
	const char *id;
	unsigned language;
} locale_ids[DB_OPCUA_LOCALE_IDS] = {
	{ "de", 0 },
	{ "zh-CN", 1 },
};

void db_opcua_locales_open(struct db_opcua_locales *locales, const char *folder)
{
	for (size_t i = 0; i < DB_OPCUA_LANGUAGES; i++)
		locales->languages[i] = db_words_open_language(folder, names[i]);
}

void db_opcua_locales_close(struct db_opcua_locales *locales)
{
	for (size_t i = 0; i < DB_OPCUA_LANGUAGES; i++)
		db_words_close_language(locales->languages[i]);
	*locales = (struct db_opcua_locales){ .languages = { NULL } };
}

UA_StatusCode db_opcua_locales_tell(const struct db_opcua_locales *locales, UA_Server *server)
{
	UA_String ids[1 + DB_OPCUA_LOCALE_IDS] = { db_opcua_string("en") };
	size_t count = 1;
	UA_Variant value;

	for (size_t i = 0; i < DB_OPCUA_LOCALE_IDS; i++) {
		if (locales->languages[locale_ids[i].language])
			ids[count++] = db_opcua_string(locale_ids[i].id);
	}
	UA_Variant_setArray(&value, ids, count, &UA_TYPES[UA_TYPES_STRING]);
	return UA_Server_writeValue(
		server, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_SERVERCAPABILITIES_LOCALEIDARRAY),
		value);
}

UA_LocalizedTextListEntry *db_opcua_locales_fill(const struct db_opcua_locales *locales,
                                                 struct db_opcua_texts *texts, const char *english,
                                                 bool all)
{
	size_t count = 0;

	for (size_t i = 0; all && i < DB_OPCUA_LANGUAGES; i++) {
		char room[DB_WORDS_TEXT_MAX];
		const char *words = db_words_in(locales->languages[i], english, room);

		texts->translations[i] = words != english ? strdup(words) : NULL;
	}
	for (size_t i = 0; i < DB_OPCUA_LOCALE_IDS; i++) {
		const char *words = texts->translations[locale_ids[i].language];

		if (!words)
			continue;
		texts->entries[count].localizedText = (UA_LocalizedText){
			.locale = db_opcua_string(locale_ids[i].id), .text = db_opcua_string(words)
		};
		texts->entries[count].next = &texts->entries[count + 1];
		count++;
	}
	/* The library answers with the last one who has asked for no other. */
	texts->entries[count].localizedText = db_opcua_english(english);
	return texts->entries;
}

void db_opcua_texts_clear(struct db_opcua_texts *texts)
{
	for (size_t i = 0; i < DB_OPCUA_LANGUAGES; i++)
		free(texts->translations[i]);
	*texts = (struct db_opcua_texts){ .translations = { NULL } };
}
