/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/locales.h"
#include "opcua/values.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

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
	/* The library answers with the last text those who have asked for none of the others. */
	texts->entries[count].localizedText = db_opcua_english(english);
	return texts->entries;
}

UA_LocalizedTextListEntry *db_opcua_locales_fill_name(
	const struct db_opcua_locales *locales,
	UA_LocalizedTextListEntry entries[1 + DB_OPCUA_LOCALE_IDS], UA_String name, const char *key,
	size_t length)
{
	size_t count = 0;

	for (size_t i = 0; key && i < DB_OPCUA_LOCALE_IDS; i++) {
		const char *words = db_words_find_name(locales->languages[locale_ids[i].language],
		                                       key, length);

		if (!words)
			continue;
		entries[count].localizedText = (UA_LocalizedText){
			.locale = db_opcua_string(locale_ids[i].id), .text = db_opcua_string(words)
		};
		entries[count].next = &entries[count + 1];
		count++;
	}
	entries[count] = (UA_LocalizedTextListEntry){ .localizedText = { .text = name } };
	return entries;
}

/* --- of a session ----------------------------------------------------------------------------- */

/* True if `wanted`, such as de-AT, has the language of `id`. */
static bool has_language(const UA_String *wanted, const char *id)
{
	size_t length = strcspn(id, "-");

	return wanted->length >= length &&
	       strncasecmp((const char *)wanted->data, id, length) == 0 &&
	       (wanted->length == length || wanted->data[length] == '-');
}

/* The place in locale_ids of the first one that the session wants, as the library chooses
 * descriptions; DB_OPCUA_LOCALE_IDS: English. */
static size_t find_locale(const struct db_opcua_locales *locales, UA_Server *server,
                          const UA_NodeId *session)
{
	UA_Variant wanted;

	UA_Variant_init(&wanted);
	if (!session ||
	    UA_Server_getSessionAttribute(
		    server, session, (UA_QualifiedName){ .name = db_opcua_string("localeIds") },
		    &wanted) != UA_STATUSCODE_GOOD ||
	    !UA_Variant_hasArrayType(&wanted, &UA_TYPES[UA_TYPES_STRING]))
		return DB_OPCUA_LOCALE_IDS;
	for (size_t i = 0; i < wanted.arrayLength; i++) {
		const UA_String *id = &((const UA_String *)wanted.data)[i];

		if (has_language(id, "en"))
			break;
		for (size_t k = 0; k < DB_OPCUA_LOCALE_IDS; k++) {
			if (locales->languages[locale_ids[k].language] &&
			    has_language(id, locale_ids[k].id))
				return k;
		}
	}
	return DB_OPCUA_LOCALE_IDS;
}

UA_LocalizedText db_opcua_locales_say(const struct db_opcua_locales *locales, UA_Server *server,
                                      const UA_NodeId *session, const char *english,
                                      char room[DB_WORDS_TEXT_MAX])
{
	size_t place = find_locale(locales, server, session);
	const char *words;

	if (place == DB_OPCUA_LOCALE_IDS)
		return db_opcua_english(english);
	words = db_words_in(locales->languages[locale_ids[place].language], english, room);
	if (words == english)
		return db_opcua_english(english);
	return (UA_LocalizedText){ .locale = db_opcua_string(locale_ids[place].id),
		                   .text = db_opcua_string(words) };
}

UA_LocalizedText db_opcua_locales_say_name(const struct db_opcua_locales *locales,
                                           UA_Server *server, const UA_NodeId *session,
                                           UA_String name)
{
	size_t place = find_locale(locales, server, session);
	const char *words = NULL;

	if (place < DB_OPCUA_LOCALE_IDS)
		words = db_words_find_name(locales->languages[locale_ids[place].language],
		                           (const char *)name.data, name.length);
	if (!words)
		return (UA_LocalizedText){ .locale = db_opcua_string("en"), .text = name };
	return (UA_LocalizedText){ .locale = db_opcua_string(locale_ids[place].id),
		                   .text = db_opcua_string(words) };
}

void db_opcua_texts_clear(struct db_opcua_texts *texts)
{
	for (size_t i = 0; i < DB_OPCUA_LANGUAGES; i++)
		free(texts->translations[i]);
	*texts = (struct db_opcua_texts){ .translations = { NULL } };
}
