/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ask.h"

#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

enum db_ctl_status db_ctl_ask(const struct db_ctl *ctl, const char *format, ...)
{
	char answer[16] = "";
	va_list arguments;

	if (ctl->yes)
		return DB_CTL_OK;
	if (ctl->json || !isatty(STDIN_FILENO))
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "nobody can be asked here; --yes does it without");
	va_start(arguments, format);
	(void)vprintf(format, arguments);
	va_end(arguments);
	(void)fputs(" [y/N] ", stdout);
	(void)fflush(stdout);
	if (fgets(answer, sizeof(answer), stdin) && (answer[0] == 'y' || answer[0] == 'Y'))
		return DB_CTL_OK;
	return db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
	                       "nothing was done");
}
