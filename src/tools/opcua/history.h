/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which values of a past time a client gets: between two moments in either direction, so many at a
 * time, with or without the ones next to the bounds (OPC 10000-11). Pure.
 */
#ifndef DRIVEBRIDGE_OPCUA_HISTORY_H
#define DRIVEBRIDGE_OPCUA_HISTORY_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Most values of one answer. */
#define DB_OPCUA_HISTORY_PAGE 2000

/* Times are microseconds since 1970-01-01 UTC, from 1 on; 0: none is given. At least two of the
 * bounds and `most` are given. */
struct db_opcua_history_query {
	int64_t start_us;
	int64_t end_us;
	size_t most; /* values of an answer; 0: as many as there is room for */
	bool bounds;
	int64_t after_us; /* where an earlier answer ended; 0: from the begin */
};

/* True if it can be answered. */
bool db_opcua_history_is_valid(const struct db_opcua_history_query *query);

/* Without a start they are read from the end on, into the past; also when the end is before it. */
bool db_opcua_history_is_backward(const struct db_opcua_history_query *query);

/* The bounds in the order of reading; 0: there is no such bound. */
int64_t db_opcua_history_first_bound(const struct db_opcua_history_query *query);
int64_t db_opcua_history_last_bound(const struct db_opcua_history_query *query);

/* What has ended after this time is concerned; 0: everything that there is. */
int64_t db_opcua_history_since(const struct db_opcua_history_query *query);

struct db_opcua_history_value {
	int64_t us;
	double number;
	bool missing; /* there is nothing next to the bound, which is at this time */
};

struct db_opcua_history_page {
	struct db_opcua_history_value list[DB_OPCUA_HISTORY_PAGE];
	size_t count;
	int64_t after_us; /* for the next answer; 0: this is all */
};

/* `values`: of the service's type HealthValue, oldest first; `field`: what is wanted of them. Those
 * without it are left out. */
void db_opcua_history_pick(const struct db_opcua_history_query *query, const json_t *values,
                           const char *field, struct db_opcua_history_page *page);

/* The field of a drive's register, NULL: no values of it are kept. */
const char *db_opcua_history_field(const char *reg);

#endif
