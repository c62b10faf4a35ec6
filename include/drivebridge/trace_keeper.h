/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Traces that are kept because there was trouble on a bus: a drive lost or at fault, a watchdog,
 * bus off. Each is copied some time later, so that it also contains what followed; the latest few
 * of each bus are kept. One thread, the network's; the time is passed in.
 */
#ifndef DRIVEBRIDGE_TRACE_KEEPER_H
#define DRIVEBRIDGE_TRACE_KEEPER_H

#include "drivebridge/trace.h"

/* The time after the trouble that is kept, too. */
#define DB_TRACE_AFTER (500 * DB_NS_PER_MS)

#define DB_TRACES_KEPT_EACH 4 /* of a bus */
#define DB_TRACES_KEPT 32

/* Why a trace was kept. */
struct db_trace_cause {
	enum db_event event;
	db_time time;
	char drive[DB_TRACE_NAME_MAX + 1]; /* "": an event of the bus */
};

struct db_trace_kept {
	uint32_t number; /* from 1, over all buses */
	char bus[DB_TRACE_NAME_MAX + 1];
	struct db_trace_cause cause;
	int64_t wall_offset; /* offset from its times to wall time, ns */
	struct db_trace *trace;
};

struct db_trace_keeper;

/* Null when out of memory. */
struct db_trace_keeper *db_trace_keeper_new(void);
/* Null is fine. */
void db_trace_keeper_free(struct db_trace_keeper *keeper);

/* Checks for new trouble on the bus; then its trace will be kept after a while. */
void db_trace_keeper_look(struct db_trace_keeper *keeper, const char *bus,
                          const struct db_trace *trace, db_time now);
/* The same for troubles that the bus's own thread does not know. */
void db_trace_keeper_note(struct db_trace_keeper *keeper, const char *bus,
                          const struct db_trace *trace, const struct db_trace_cause *cause,
                          db_time now);
/* The trace is about to be freed. */
void db_trace_keeper_leave(struct db_trace_keeper *keeper, const struct db_trace *trace,
                           int64_t wall_offset);

/* When db_trace_keeper_run() has something to keep; DB_TIME_NEVER. */
db_time db_trace_keeper_next(const struct db_trace_keeper *keeper);
void db_trace_keeper_run(struct db_trace_keeper *keeper, db_time now, int64_t wall_offset);

/* In the order of keeping; null after the last. Valid until something is kept. */
const struct db_trace_kept *db_trace_keeper_at(const struct db_trace_keeper *keeper, size_t place);

#endif
