/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which events are new. The first answer to Events with `more` has all events that the service
 * remembers: those sent before the connection broke, and those of the time without a connection.
 * Times cannot tell them apart, because clocks are set; numbers can, and they begin again with each
 * run of the service. Pure.
 */
#ifndef DRIVEBRIDGE_CLIENT_EVENTS_H
#define DRIVEBRIDGE_CLIENT_EVENTS_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

struct db_client_events {
	/* before any was seen: events from this time on are new (microseconds since 1970-01-01
	 * UTC) */
	int64_t from_us;
	/* The latest event seen; number 0: none yet. */
	int64_t number;
	int64_t time_us;
	/* The first answer has arrived: all later ones are new. False again for a new connection.
	 */
	bool connected;
};

/* The number of events at the beginning of an answer's `events` that are not new. The others count
 * as seen from now on. */
size_t db_client_events_skip(struct db_client_events *seen, const json_t *events);

#endif
