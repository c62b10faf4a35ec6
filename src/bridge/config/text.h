/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Values of the configuration from their text; false when the text is no such value. Pure, but for
 * db_text_put_word().
 */
#ifndef DRIVEBRIDGE_CONFIG_TEXT_H
#define DRIVEBRIDGE_CONFIG_TEXT_H

#include "drivebridge/config.h"

#include <stdbool.h>
#include <stdio.h>

/* Digits only, at most 4294967295. */
bool db_text_number(const char *text, unsigned *number);

/* Begins with 0x. */
bool db_text_is_hex(const char *text);

/* Whole number, -4294967295..4294967295; without sign also hexadecimal with 0x. */
bool db_text_integer(const char *text, double *number);

/* Finite decimal number, '.' whatever the locale. */
bool db_text_real(const char *text, double *number);

/* Position of the text in a list of words separated by spaces. */
bool db_text_word(const char *text, const char *words, unsigned *position);

/* Writes the word at a position of such a list. */
void db_text_put_word(FILE *out, const char *words, unsigned position);

/* "192.168.1.5:502" or "[::1]:502", numeric addresses only, port 0..65535. */
bool db_text_listen(const char *text);

/* "3", "2-3,5": processors 0..63, as bits; ranges rise. "any": none of them. */
bool db_text_cpus(const char *text, uint64_t *cpus);

#define DB_CPUS_TEXT_MAX 192

/* In the form that db_text_cpus() reads. */
void db_text_of_cpus(uint64_t cpus, char text[DB_CPUS_TEXT_MAX]);

#define DB_UNITS_SIZE 32
#define DB_UNITS_ALL "1-247"

/* "3", "10-19": adds unit ids of a serial line, 1..247, as bits; ranges rise. */
bool db_text_units(const char *text, uint8_t units[DB_UNITS_SIZE]);

/* "3, 10-19", with quotes around each where `quote` is "\""; the longest has every second one. */
#define DB_UNITS_TEXT_MAX 1024
void db_text_of_units(const uint8_t units[DB_UNITS_SIZE], const char *quote,
                      char text[DB_UNITS_TEXT_MAX]);

enum db_network_error {
	DB_NETWORK_OK,
	DB_NETWORK_NO_ADDRESS, /* not a numeric IPv4 or IPv6 address */
	DB_NETWORK_PREFIX,     /* the prefix is no number, or too long */
	DB_NETWORK_HOST_BITS,  /* bits beyond the prefix are set; *network has them cleared */
};

/* "10.0.0.0/8", "10.1.2.3", "fd00::/8", "::1". */
enum db_network_error db_text_network(const char *text, struct db_network *network);

#define DB_NETWORK_TEXT_MAX 52

/* In the form that db_text_network() reads. */
void db_text_of_network(const struct db_network *network, char text[DB_NETWORK_TEXT_MAX]);

#endif
