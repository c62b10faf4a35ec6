/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Messages for people, a line each, on standard error. Under systemd each line carries the "<N>"
 * prefix that gives it its level in the journal; on a terminal it carries none. Any thread.
 */
#ifndef DRIVEBRIDGE_LOG_H
#define DRIVEBRIDGE_LOG_H

/* Values are syslog's. */
enum db_log_level {
	DB_LOG_ERROR = 3,
	DB_LOG_WARNING = 4,
	DB_LOG_NOTICE = 5,
	DB_LOG_INFO = 6,
};

__attribute__((format(printf, 2, 3))) void db_log(enum db_log_level level, const char *format, ...);

#endif
