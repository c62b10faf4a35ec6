/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Silence is safe: notices that nobody who may command a drive talks to it any more. Armed by the
 * first motion command, fed by requests, by writes that were admitted or by a heartbeat; when it
 * expires it latches until it is reset. Pure: time is passed in, one thread.
 *
 * Times that it is told of are those at which a request arrived, which may be long before it is
 * served: what was asked before shows nothing about now, and never undoes what came later.
 *
 * Who commands the drive is who has commanded it since the watchdog was armed. Of reads that is a
 * connection, not an address: a monitor may run on the same machine as the PLC. A write counts also
 * from another connection of its address: a PLC that connects anew and repeats its command.
 *
 * With DB_FEED_HEARTBEAT nothing that an I/O scanner repeats by itself keeps a drive moving after
 * the program of its PLC has died: neither the same motion command again nor the same settings.
 */
#ifndef DRIVEBRIDGE_AXIS_WATCHDOG_H
#define DRIVEBRIDGE_AXIS_WATCHDOG_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Connections that are remembered as those that command the drive; the one that did so first gives
 * way. */
#define DB_WATCHDOG_COMMANDERS 4

struct db_watchdog_commander {
	uint32_t client; /* DB_CLIENT_NOBODY: its connection has ended */
	bool taken;
	uint8_t address[16];
};

struct db_watchdog {
	uint32_t timeout_ms; /* 0 = off */
	enum db_watchdog_feed feed;
	bool armed;
	bool latched;
	db_time latched_at;
	bool was_commanded_by_plc; /* since it was armed; likewise the next */
	bool session_has_left;
	db_time fed;
	uint32_t trips; /* since the start */
	struct db_watchdog_commander commanders[DB_WATCHDOG_COMMANDERS];
	unsigned next_commander; /* the place to be taken next */
};

void db_watchdog_init(struct db_watchdog *watchdog, uint32_t timeout_ms,
                      enum db_watchdog_feed feed);

/* 0 turns it off, which does not undo a latch. Another time counts from now; the same one again is nothing new. */
void db_watchdog_set(struct db_watchdog *watchdog, uint32_t timeout_ms, db_time now);

/* A motion command was taken. */
void db_watchdog_arm(struct db_watchdog *watchdog, db_time now);

/* This client has commanded the drive, otherwise than by a stop. May be DB_CLIENT_NOBODY. */
void db_watchdog_commanded(struct db_watchdog *watchdog, const struct db_client *client);
/* Whether it has, over this connection or another one of its address. */
bool db_watchdog_is_commanded_by(const struct db_watchdog *watchdog,
                                 const struct db_client *client);
/* Whether anybody has, since it was armed. */
bool db_watchdog_is_commanded(const struct db_watchdog *watchdog);
/* Its connection has ended. */
void db_watchdog_forget(struct db_watchdog *watchdog, uint32_t client);

/*
 * A client who may write addressed the drive: `by` a request of any kind (REQUESTS), a write that was
 * admitted, or a heartbeat that has changed. A write of who does not command the drive is a request like
 * any other, a heartbeat where none is asked for a write. It is fed when that is enough for it, and says
 * whether it was.
 */
bool db_watchdog_feed(struct db_watchdog *watchdog, enum db_watchdog_feed by,
                      const struct db_client *client, db_time now);

/*
 * Only sessions of the control socket have commanded the drive since it was armed, and they have gone: somebody's
 * command is done, and if the drive stands, nothing is lost. A PLC that goes is lost in any case.
 */
bool db_watchdog_is_deserted(const struct db_watchdog *watchdog);
/* There is nothing to watch until the next motion command. */
void db_watchdog_disarm(struct db_watchdog *watchdog);

/* When it will expire; DB_TIME_NEVER while it is off, not armed or latched. */
db_time db_watchdog_deadline(const struct db_watchdog *watchdog);

/* True once when the time is up: latches and disarms. */
bool db_watchdog_trip(struct db_watchdog *watchdog, db_time now);

/* Ends the latch; the next motion command arms it again. */
void db_watchdog_reset(struct db_watchdog *watchdog);

/* Milliseconds left; 0 while it is off, not armed or latched. */
uint32_t db_watchdog_remaining_ms(const struct db_watchdog *watchdog, db_time now);

#endif
