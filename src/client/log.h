/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lines of a tool that serves, for the journal on standard error: with the level in front as sd-daemon(3) has it where
 * the journal reads, else with the name of the program.
 */
#ifndef DRIVEBRIDGE_CLIENT_LOG_H
#define DRIVEBRIDGE_CLIENT_LOG_H

#include "drivebridge/time.h"

enum db_client_level {
	DB_CLIENT_ERROR = 3,
	DB_CLIENT_WARNING = 4,
	DB_CLIENT_NOTICE = 5,
	DB_CLIENT_INFO = 6
};

/* A sentence without a full stop; control characters of foreign texts become question marks. */
void db_client_log(enum db_client_level level, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

/* How many lines of one kind there are in a minute, of those that anybody who reaches the program can cause as often as he
 * likes; then one more, which says that further ones are left out. */
#define DB_CLIENT_LOG_RATION 30

/* All 0 at first. */
struct db_client_log_ration {
	db_time begun; /* the minute */
	unsigned count;
};

/* As db_client_log(), within the ration. */
void db_client_log_rationed(struct db_client_log_ration *ration, db_time now,
                            enum db_client_level level, const char *format, ...)
	__attribute__((format(printf, 4, 5)));

#endif
