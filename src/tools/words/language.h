/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Texts in another language, from the files that msgfmt makes of po/. The service and all programs
 * write English; the program that shows a text to people translates it. Several languages may be
 * open at once, and none needs a locale of the system: gateways seldom have more than C.UTF-8.
 *
 * Texts are UTF-8. A language does not change after it was opened: any number of threads may use
 * it.
 */
#ifndef DRIVEBRIDGE_WORDS_LANGUAGE_H
#define DRIVEBRIDGE_WORDS_LANGUAGE_H

#include <stdbool.h>
#include <stddef.h>

/* The longest text that is put together from others; what is longer is shown in English. */
#define DB_WORDS_TEXT_MAX 2048
/* Of a name such as "zh_CN". */
#define DB_WORDS_LANGUAGE_MAX 16

struct db_words_language;

/*
 * What the environment asks for by LANGUAGE, LC_ALL, LC_MESSAGES and LANG, in gettext's order: the
 * name of a language that exists in `folder`, or "" for English: also for C and POSIX, and for
 * characters other than UTF-8. `get` is getenv(). True if it is not English.
 */
bool db_words_choose_language(const char *folder, char *(*get)(const char *name),
                              char language[DB_WORDS_LANGUAGE_MAX]);

/* The folder in which languages are installed, or the one that gettext(1)'s variable TEXTDOMAINDIR
 * names: for tests and translators. `get` is getenv(). */
const char *db_words_folder(char *(*get)(const char *name));

/* Opens FOLDER/LANGUAGE/LC_MESSAGES/drivebridge.mo. Null with errno: EINVAL for a file of another
 * kind. */
struct db_words_language *db_words_open_language(const char *folder, const char *language);

void db_words_close_language(struct db_words_language *language);

/* The translation of an English text of the sources, such as a format of printf; `english` itself
 * where there is none, and where `language` is null. It is valid as long as the language is open.
 */
const char *db_words_find_text(const struct db_words_language *language, const char *english)
	__attribute__((format_arg(2)));

/* The words for a name of the tables, such as "no answer" in that language for "no_answer"; null:
 * there are none. `name` needs no end. */
const char *db_words_find_name(const struct db_words_language *language, const char *name,
                               size_t length);

/* The length of a register's name without its unit at the end: of "age_ms" in ms that of "age".
 * People read the unit with the value. `unit` may be empty. */
size_t db_words_name_length(const char *name, const char *unit);

/* The same of one of two texts, by a number. */
const char *db_words_find_count(const struct db_words_language *language, size_t count,
                                const char *one, const char *several)
	__attribute__((format_arg(3), format_arg(4)));

/*
 * The translation of a finished text, with its values in it, as the service sends it: "no drive is
 * called "feeder"". Values that are texts of the table, such as a reason in an advice, are
 * translated, too; names are not: what stands in quotes or after "drive ", "bus ", "of " or "--", a
 * single word at the beginning, and {name}, {names}, {drive}, {bus}, {command}. After a name with a
 * colon ("plant.conf:7: ...") a text of its own begins. The result is `room`, a text of the table
 * or `english`.
 */
const char *db_words_in(const struct db_words_language *language, const char *english,
                        char room[DB_WORDS_TEXT_MAX]);

/* The columns that a text of `bytes` bytes takes on a terminal: Chinese characters take two each.
 */
unsigned db_words_columns(const char *text, size_t bytes);

/* The bytes of the longest beginning of a text that fits in so many columns, whole characters only:
 * for "%.*s". */
int db_words_fit(const char *text, unsigned columns);

#endif
