/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which records of the audit trail a client gets as events of the past: between two moments in
 * either direction, some at a time. The service gives its trail in pages, oldest first (its method
 * Audit): so the latest ones are searched for in windows of numbers, each as a whole.
 *
 * Pure: no I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_TRAIL_H
#define DRIVEBRIDGE_OPCUA_TRAIL_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Most records of one answer. A record has up to 8 KiB. */
#define DB_OPCUA_TRAIL_PAGE 100

/* As struct db_opcua_history_query. */
struct db_opcua_trail_query {
	char drive[64]; /* only of this one; "": all records */
	int64_t start_us;
	int64_t end_us;
	size_t most;
	int64_t after; /* where an earlier answer ended: a number of a record; 0: from the begin */
};

enum db_opcua_trail_step {
	DB_OPCUA_TRAIL_FORWARD, /* from the first one on */
	DB_OPCUA_TRAIL_HIGH,    /* backward: searches where the range begins ... */
	DB_OPCUA_TRAIL_LOW,     /* ... and where it ends, */
	DB_OPCUA_TRAIL_WINDOW,  /* and then reads windows, the latest first */
};

/* A search; empty when all is 0. */
struct db_opcua_trail {
	struct db_opcua_trail_query query;
	enum db_opcua_trail_step step;
	int64_t from; /* where the next page begins */
	int64_t low;  /* backward: first number of the range, */
	int64_t high; /* the number after the last one that is still to be read, */
	int64_t width;
	int64_t window_low;
	json_t *window; /* and the latest records of the window, oldest first */
	json_t *found;  /* the result, in the order of reading */
	int64_t after;  /* for the next answer; 0: this is all */
	bool kept;      /* the service keeps a trail in files */
};

/* False: without memory. Ended with db_opcua_trail_clear(). */
bool db_opcua_trail_begin(struct db_opcua_trail *trail, const struct db_opcua_trail_query *query);
void db_opcua_trail_clear(struct db_opcua_trail *trail);

/* What to call the service's method Audit with; NULL without memory. */
json_t *db_opcua_trail_question(const struct db_opcua_trail *trail);

/* Takes its answer. True: the result is complete; else the next question follows. */
bool db_opcua_trail_take(struct db_opcua_trail *trail, const json_t *answer);

#endif
