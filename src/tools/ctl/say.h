/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What people read in their language: main() opens it once, before anything is written. What
 * programs read
 * (--json, CSV, configurations) stays English and goes around this file.
 */
#ifndef DRIVEBRIDGE_CTL_SAY_H
#define DRIVEBRIDGE_CTL_SAY_H

#include "ctl/say.h"
#include "words/language.h"

#include <stdio.h>

/* Opens the language that the environment asks for, to the end; without one all texts are English.
 */
void db_ctl_open_language(void);

/* A text of the sources, which may be a format of printf. tests/tools/texts finds the calls. */
const char *db_ctl_say(const char *english) __attribute__((format_arg(1)));

/* One of two by a number. */
const char *db_ctl_say_count(size_t count, const char *one, const char *several)
	__attribute__((format_arg(2), format_arg(3)));

/* A name of the service, such as no_answer, in words; English: as it is. */
const char *db_ctl_say_name(const char *name);

/* Marks a text of a table, which is translated where it is shown. tests/tools/texts finds these,
 * too. */
#define DB_CTL_TEXT(english) english

/* Writes a line: a format of the sources with its values, and the end of the line. */
void db_ctl_say_line(FILE *out, const char *english, ...) __attribute__((format(printf, 2, 3)));

/* A finished text, such as one of the service; `room` may hold the result. */
const char *db_ctl_translate(const char *english, char room[DB_WORDS_TEXT_MAX]);

/* Writes a finished text of several lines, each of them translated; spaces at their beginnings
 * stay. */
void db_ctl_translate_lines(FILE *out, const char *english);

/* The language that is open; null for English. */
const struct db_words_language *db_ctl_language(void);

#endif
