/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void db_log(enum db_log_level level, const char *format, ...)
{
	char line[512];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(line, sizeof line, format, arguments);
	va_end(arguments);
	/* One call per line, so that lines of two threads never mix. */
	if (getenv("JOURNAL_STREAM"))
		fprintf(stderr, "<%d>%s\n", (int)level, line);
	else
		fprintf(stderr, "%s\n", line);
}
