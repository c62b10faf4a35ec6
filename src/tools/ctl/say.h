/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What people read in their language: main() opens it once, before anything is written. What programs read
 * (--json, CSV, configurations) stays English and goes around this file.
 */
#ifndef DRIVEBRIDGE_CTL_SAY_H
#define DRIVEBRIDGE_CTL_SAY_H

#include "words/language.h"

/* Opens the language that the environment asks for; without one all texts are English. */
void db_ctl_open_language(void);
void db_ctl_close_language(void);

/* A text of the sources, which may be a format of printf. tests/tools/texts finds the calls. */
const char *db_ctl_say(const char *english) __attribute__((format_arg(1)));

/* One of two by a number. */
const char *db_ctl_say_count(size_t count, const char *one, const char *several)
	__attribute__((format_arg(2), format_arg(3)));

/* A name of the service, such as no_answer, in words; English: as it is. */
const char *db_ctl_say_name(const char *name);

/* A finished text, such as one of the service; `room` may hold the result. */
const char *db_ctl_translate(const char *english, char room[DB_WORDS_TEXT_MAX]);

#endif
