/* SPDX-License-Identifier: Apache-2.0 */
#include "client/log.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

__attribute__((format(printf, 2, 0))) static void write_line(enum db_client_level level,
                                                             const char *format, va_list arguments)
{
	char line[1024];

	(void)vsnprintf(line, sizeof(line), format, arguments);
	for (char *at = line; *at; at++) {
		unsigned char byte = (unsigned char)*at;

		if (byte < 0x20 || byte == 0x7F)
			*at = '?';
	}
	if (getenv("JOURNAL_STREAM"))
		(void)fprintf(stderr, "<%d>%s\n", (int)level, line);
	else
		(void)fprintf(stderr, "%s: %s\n", program_invocation_short_name, line);
}

void db_client_log(enum db_client_level level, const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	write_line(level, format, arguments);
	va_end(arguments);
}

void db_client_log_rationed(struct db_client_log_ration *ration, db_time now,
                            enum db_client_level level, const char *format, ...)
{
	va_list arguments;

	if (ration->count == 0 || now - ration->begun >= 60 * DB_NS_PER_S) {
		ration->begun = now;
		ration->count = 0;
	}
	if (ration->count > DB_CLIENT_LOG_RATION)
		return;
	ration->count++;
	va_start(arguments, format);
	if (ration->count <= DB_CLIENT_LOG_RATION)
		write_line(level, format, arguments);
	else
		db_client_log(level,
		              "further lines such as the last ones are left out for a minute");
	va_end(arguments);
}
