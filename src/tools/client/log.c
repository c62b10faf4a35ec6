/* SPDX-License-Identifier: Apache-2.0 */
#include "client/log.h"

#include "drivebridge/hash.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

__attribute__((format(printf, 2, 0))) static void write_line(enum db_client_level level,
                                                             const char *format, va_list arguments)
{
	char line[1024];

	vsnprintf(line, sizeof(line), format, arguments);
	for (char *at = line; *at; at++) {
		unsigned char byte = (unsigned char)*at;

		if (byte < 0x20 || byte == 0x7F)
			*at = '?';
	}
	if (getenv("JOURNAL_STREAM"))
		fprintf(stderr, "<%d>%s\n", (int)level, line);
	else
		fprintf(stderr, "%s: %s\n", program_invocation_short_name, line);
}

void db_client_log(enum db_client_level level, const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	write_line(level, format, arguments);
	va_end(arguments);
}

#define MINUTE (60 * DB_NS_PER_S)

static bool is_over(const struct db_client_log_ration *ration, db_time now)
{
	return ration->count == 0 || now - ration->begun >= MINUTE;
}

/* Counts a line. Above `most`: it is left out; just above: this is to be said. */
static unsigned count_line(struct db_client_log_ration *ration, unsigned most, db_time now)
{
	if (is_over(ration, now)) {
		ration->begun = now;
		ration->count = 0;
	}
	if (ration->count <= most)
		return ++ration->count;
	return most + 2;
}

void db_client_log_rationed(struct db_client_log_ration *ration, db_time now,
                            enum db_client_level level, const char *format, ...)
{
	unsigned count = count_line(ration, DB_CLIENT_LOG_RATION, now);
	va_list arguments;

	va_start(arguments, format);
	if (count <= DB_CLIENT_LOG_RATION)
		write_line(level, format, arguments);
	else if (count == DB_CLIENT_LOG_RATION + 1)
		db_client_log(level,
		              "further lines such as the last ones are left out for a minute");
	va_end(arguments);
}

bool db_client_log_is_due(const struct db_client_log_ration *ration, db_time now)
{
	return is_over(ration, now) || ration->count < DB_CLIENT_LOG_RATION;
}

/* Never 0. */
static uint64_t key_of(const char *address)
{
	unsigned char bytes[16];
	uint64_t key = inet_pton(AF_INET6, address, bytes) == 1 ?
	                       db_hash_add(DB_HASH_BEGIN, bytes, 8) :
	                       db_hash_add(DB_HASH_BEGIN, address, strlen(address));

	return key ? key : 1;
}

void db_client_log_rationed_for(struct db_client_log_rations *rations, const char *address,
                                db_time now, enum db_client_level level, const char *format, ...)
{
	struct db_client_log_ration *ration = NULL;
	uint64_t key = key_of(address);
	size_t place = DB_CLIENT_LOG_PLACES;
	va_list arguments;
	unsigned count;

	for (size_t i = 0; i < DB_CLIENT_LOG_PLACES && !ration; i++) {
		if (rations->places[i].key == key)
			ration = &rations->places[i].ration;
		else if (place == DB_CLIENT_LOG_PLACES && is_over(&rations->places[i].ration, now))
			place = i;
	}
	if (!ration && place < DB_CLIENT_LOG_PLACES) {
		rations->places[place].key = key;
		ration = &rations->places[place].ration;
	}
	ration = ration ? ration : &rations->others;
	count = count_line(ration, DB_CLIENT_LOG_RATION_EACH, now);
	va_start(arguments, format);
	if (count <= DB_CLIENT_LOG_RATION_EACH)
		write_line(level, format, arguments);
	else if (count == DB_CLIENT_LOG_RATION_EACH + 1)
		db_client_log(level, "further lines about %s are left out for a minute",
		              ration == &rations->others ? "still more addresses" : address);
	va_end(arguments);
}
