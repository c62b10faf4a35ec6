/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/say.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* As the C library keeps the one of gettext(): it is set once, while there is one thread. */
static struct db_words_language *language;

void db_ctl_open_language(void)
{
	const char *folder = db_words_folder(getenv);
	char name[DB_WORDS_LANGUAGE_MAX];

	/* A file that cannot be read leaves English, which is better than no program. */
	if (db_words_choose_language(folder, getenv, name))
		language = db_words_open_language(folder, name);
}

const char *db_ctl_say(const char *english)
{
	return db_words_find_text(language, english);
}

const char *db_ctl_say_count(size_t count, const char *one, const char *several)
{
	return db_words_find_count(language, count, one, several);
}

void db_ctl_say_line(FILE *out, const char *english, ...)
{
	va_list arguments;

	va_start(arguments, english);
	vfprintf(out, db_ctl_say(english), arguments);
	va_end(arguments);
	fputc('\n', out);
}

const char *db_ctl_say_name(const char *name)
{
	const char *found = db_words_find_name(language, name, strlen(name));

	return found ? found : name;
}

const char *db_ctl_translate(const char *english, char room[DB_WORDS_TEXT_MAX])
{
	return db_words_in(language, english, room);
}

void db_ctl_translate_lines(FILE *out, const char *english)
{
	while (*english) {
		size_t blanks = strspn(english, " ");
		size_t length = strcspn(english, "\n");
		char line[DB_WORDS_TEXT_MAX];
		char room[DB_WORDS_TEXT_MAX];

		if (length >= sizeof(line)) {
			fprintf(out, "%.*s", (int)length, english);
		} else {
			memcpy(line, english, length);
			line[length] = '\0';
			fprintf(out, "%.*s%s", (int)blanks, line,
			        db_words_in(language, line + blanks, room));
		}
		english += length;
		if (*english == '\n')
			fputc(*english++, out);
	}
}

const struct db_words_language *db_ctl_language(void)
{
	return language;
}
