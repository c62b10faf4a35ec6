/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lines of a tool that serves, for the journal on standard error: with the level in front as sd-daemon(3) has it where
 * the journal reads, else with the name of the program.
 */
#ifndef DRIVEBRIDGE_CLIENT_LOG_H
#define DRIVEBRIDGE_CLIENT_LOG_H

enum db_client_level {
	DB_CLIENT_ERROR = 3,
	DB_CLIENT_WARNING = 4,
	DB_CLIENT_NOTICE = 5,
	DB_CLIENT_INFO = 6
};

/* A sentence without a full stop; control characters of foreign texts become question marks. */
void db_client_log(enum db_client_level level, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

#endif
