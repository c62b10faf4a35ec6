/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which events are news. The first answer to Events, with `more`, tells what the service remembers: what was told before
 * the connection broke is among it, and what happened while there was none. Clocks are set, so times do not say which
 * is which; numbers do, which begin again with each run of the service. Pure.
 */
#ifndef DRIVEBRIDGE_CLIENT_EVENTS_H
#define DRIVEBRIDGE_CLIENT_EVENTS_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

struct db_client_events {
	int64_t from_us; /* before any was seen: those from then on are news (microseconds since 1970-01-01 UTC) */
	/* The latest that was seen; number 0: none yet. */
	int64_t number;
	int64_t time_us;
	bool connected; /* the first answer has come: all are news */
};

/* There is a new connection: the next answer is the first one. */
void db_client_events_connect(struct db_client_events *seen);

/* How many at the beginning of an answer's `events` are no news. Those behind them count as seen from now on. */
size_t db_client_events_skip(struct db_client_events *seen, const json_t *events);

#endif
