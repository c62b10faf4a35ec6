/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Members of the service's objects. Values of registers in words, and words as values: units, names
 * of codes and of bits, ranges, all as the service describes the register (an object of the
 * interface's type Register, or NULL if unknown).
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WORDS_VALUE_H
#define DRIVEBRIDGE_WORDS_VALUE_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define DB_WORDS_VALUE_MAX 1024

/* A text member, "" when there is none. */
const char *db_words_text(const json_t *object, const char *name);

/* A whole number and a flag among the members; 0 and false when there is none. */
json_int_t db_words_number(const json_t *object, const char *name);
bool db_words_flag(const json_t *object, const char *name);

/* The object of that `name` in a list, or NULL. */
json_t *db_words_look_up(const json_t *list, const char *name);

/* True if this text is in a list. */
bool db_words_has_text(const json_t *texts, const char *text);

/* "3200 counts", "Standstill", "online, enabled"; "-" when it is unknown. */
void db_words_write_value(const json_t *reg, const json_t *value, char *text, size_t size);

/* The same without the unit. */
void db_words_write_bare_value(const json_t *reg, const json_t *value, char *text, size_t size);

/* The name of a code of this register, NULL when it has none. */
const char *db_words_code_name(const json_t *reg, json_int_t code);

/*
 * What a number means by the register's `description`: "0=none 1=with the motor; closed loop only"
 * says "with the motor" of 1. False: it does not say, or the register has a name for it.
 */
#define DB_WORDS_MEANING_MAX 128
bool db_words_meaning(const json_t *reg, const char *description, const json_t *value, char *text,
                      size_t size);

/* True if the bit of that name is set. */
bool db_words_has_bit(const json_t *reg, const json_t *value, const char *name);

/*
 * Typed text as a value for this register: numbers, names of codes, names of bits with commas
 * between. NULL with what would be right in `problem`. The caller frees it.
 */
json_t *db_words_parse_value(const json_t *reg, const char *text, char *problem, size_t size);

/* "2026-11-22 16:20:02.113" in local time, from microseconds since 1970-01-01 UTC. */
#define DB_WORDS_TIME_MAX 40
void db_words_write_time(json_int_t us, char text[DB_WORDS_TIME_MAX]);

/* A time in seconds, more than 0 and at most ten days. False: it is not valid. */
bool db_words_parse_seconds(const char *text, double *seconds);

/* Replaces control characters in a text of the service or of a drive, and those that turn the
 * direction of what follows, for output on a terminal. */
void db_words_clean(char *text);

#endif
