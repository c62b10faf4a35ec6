/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Log lines of a companion service, on standard error for the journal: with the level in front as
 * in sd-daemon(3) where the journal reads them, else with the name of the program.
 */
#ifndef DRIVEBRIDGE_CLIENT_LOG_H
#define DRIVEBRIDGE_CLIENT_LOG_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

enum db_client_level {
	DB_CLIENT_ERROR = 3,
	DB_CLIENT_WARNING = 4,
	DB_CLIENT_NOTICE = 5,
	DB_CLIENT_INFO = 6
};

/* A sentence without a full stop; control characters in foreign texts become question marks. */
void db_client_log(enum db_client_level level, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

/* Most lines per minute of one kind that anybody who reaches the program can cause; one more line
 * says that further ones are left out. */
#define DB_CLIENT_LOG_RATION 30

/* All 0 at first. */
struct db_client_log_ration {
	db_time begun; /* of the current minute */
	unsigned count;
};

/* As db_client_log(), within the limit. */
void db_client_log_rationed(struct db_client_log_ration *ration, db_time now,
                            enum db_client_level level, const char *format, ...)
	__attribute__((format(printf, 4, 5)));

/* False: such a line would be left out now. */
bool db_client_log_is_due(const struct db_client_log_ration *ration, db_time now);

/* The same with a ration of its own for each address, so that the lines that one causes hide no
 * other's. Bounded: addresses that come when all places are taken within a minute share one. */
#define DB_CLIENT_LOG_RATION_EACH 10
#define DB_CLIENT_LOG_PLACES 64

/* All 0 at first. */
struct db_client_log_rations {
	struct {
		uint64_t key; /* 0: free */
		struct db_client_log_ration ration;
	} places[DB_CLIENT_LOG_PLACES];
	struct db_client_log_ration others;
};

/* `address` as inet_ntop(3) writes it; one of IPv6 counts by its first 64 bits. */
void db_client_log_rationed_for(struct db_client_log_rations *rations, const char *address,
                                db_time now, enum db_client_level level, const char *format, ...)
	__attribute__((format(printf, 5, 6)));

#endif
