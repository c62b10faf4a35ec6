/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Silence is safe: notices that nobody who may command a drive talks to it any more. Armed by the
 * first motion command, fed by requests; when it expires it latches until it is reset. Pure: time is
 * passed in, one thread.
 */
#ifndef DRIVEBRIDGE_AXIS_WATCHDOG_H
#define DRIVEBRIDGE_AXIS_WATCHDOG_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

struct db_watchdog {
	uint32_t timeout_ms; /* 0 = off */
	bool armed;
	bool latched;
	db_time fed;
	uint32_t trips; /* since the start */
};

void db_watchdog_init(struct db_watchdog *watchdog, uint32_t timeout_ms);

/* 0 turns it off, which does not undo a latch. The new time counts from now. */
void db_watchdog_set(struct db_watchdog *watchdog, uint32_t timeout_ms, db_time now);

/* A motion command was taken. */
void db_watchdog_arm(struct db_watchdog *watchdog, db_time now);

/* Somebody who may write addressed the drive. */
void db_watchdog_feed(struct db_watchdog *watchdog, db_time now);

/* When it will expire; DB_TIME_NEVER while it is off, not armed or latched. */
db_time db_watchdog_deadline(const struct db_watchdog *watchdog);

/* True once when the time is up: latches and disarms. */
bool db_watchdog_trip(struct db_watchdog *watchdog, db_time now);

/* Ends the latch; the next motion command arms it again. */
void db_watchdog_reset(struct db_watchdog *watchdog);

/* Milliseconds left; 0 while it is off, not armed or latched. */
uint32_t db_watchdog_remaining_ms(const struct db_watchdog *watchdog, db_time now);

#endif
