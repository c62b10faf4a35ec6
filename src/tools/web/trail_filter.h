/* SPDX-License-Identifier: Apache-2.0 */
/* Which records of the audit trail a page asks for, and which of them its user may see. Pure. */
#ifndef DRIVEBRIDGE_WEB_TRAIL_FILTER_H
#define DRIVEBRIDGE_WEB_TRAIL_FILTER_H

#include "users/roles.h"

#include <jansson.h>
#include <stdbool.h>

/* With the terminating zero; the service takes 63 bytes. */
#define DB_WEB_TRAIL_TEXT 64

/* 0, false and "" leave out nothing. */
struct db_web_trail_filter {
	struct db_grant grant;       /* of who asks */
	char who[DB_WEB_TRAIL_TEXT]; /* a part of the words for who */
	char drive[DB_WEB_TRAIL_TEXT];
	char kind[DB_WEB_TRAIL_TEXT];
	char way[DB_WEB_TRAIL_TEXT];  /* one of db_capture_audit_ways */
	char text[DB_WEB_TRAIL_TEXT]; /* a part of what the record is in words */
	json_int_t since_us;          /* since 1970-01-01 UTC */
	json_int_t until_us;
	bool refused; /* only what was refused or failed */
};

/* Reads { who, drive, kind, through, text, since_us, until_us, refused }, all optional; others are
 * ignored. False: one of them has a wrong type or size. `filter->grant` stays. */
bool db_web_trail_filter_read(struct db_web_trail_filter *filter, const json_t *parameters);

/* The parameters of the service's method Audit from this record on: a new object. The service
 * leaves out as much as it can. */
json_t *db_web_trail_filter_query(const struct db_web_trail_filter *filter, json_int_t from);

/* Whether a record is wanted, and its user may see it. Who has not all drives sees the records of
 * his own: those without a drive name users and addresses of everybody. */
bool db_web_trail_filter_has(const struct db_web_trail_filter *filter, const json_t *record);

/* Adds to a record what a page shows: `line`, `through`, `failed`. */
void db_web_trail_describe(json_t *record);

#endif
