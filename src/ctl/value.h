/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Values of registers in words, and words as values: units, names of codes and of bits, ranges, all as the service
 * describes the register (an object of the interface's type Register, or NULL where it is not known).
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_CTL_VALUE_H
#define DRIVEBRIDGE_CTL_VALUE_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define DB_CTL_VALUE_MAX 1024

/* "3200 counts", "Standstill", "online, enabled"; "-" when it is not known. */
void db_ctl_write_value(const json_t *reg, const json_t *value, char *text, size_t size);

/* The same without the unit. */
void db_ctl_write_bare_value(const json_t *reg, const json_t *value, char *text, size_t size);

/* The name of a code of this register, NULL when it has none. */
const char *db_ctl_code_name(const json_t *reg, json_int_t code);

/* Whether the bit of that name is set. */
bool db_ctl_has_bit(const json_t *reg, const json_t *value, const char *name);

/*
 * What somebody typed, as a value for this register: numbers, names of codes, names of bits with commas between.
 * NULL with what would be right in `problem`. The caller frees it.
 */
json_t *db_ctl_parse_value(const json_t *reg, const char *text, char *problem, size_t size);

/* "2026-11-22 16:20:02.113" of this place, from microseconds since 1970-01-01 UTC. */
#define DB_CTL_TIME_MAX 40
void db_ctl_write_time(json_int_t us, char text[DB_CTL_TIME_MAX]);

/* A time in seconds, more than 0 and at most ten days. False: it is none. */
bool db_ctl_parse_seconds(const char *text, double *seconds);

/* A text of the service or of a drive as a terminal may show it: no control characters. */
void db_ctl_clean(char *text);

#endif
