/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Calls that have an id of their callers' own, and how they ended: so that the same call, which comes again over
 * another connection or from a tool that was started anew, is carried out once. An id is one for each drive and each
 * user: who the process's user is, and for whom it acts.
 *
 * Bounded: of each drive the latest DB_IDS_EACH ids, in one block that is allocated with the drive's first one. An id
 * is not forgotten before its time is over; who has more of them is refused.
 *
 * Pure but for that memory; time is handed in. Network thread only. Internal to src/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_IDS_H
#define DRIVEBRIDGE_CONTROL_IDS_H

#include "drivebridge/client.h"
#include "drivebridge/result.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>

/* Bytes of an id, at least 1. */
#define DB_ID_MAX 64

/* Ids that are kept for each drive, and drives that have some. */
#define DB_IDS_EACH 64
#define DB_IDS_OF_USER 48 /* at most, so that one user leaves places to the others */
#define DB_IDS_DRIVES 256

/* The longest that a call may wait, and how long its id is kept when it does not say. */
#define DB_IDS_TIME_MAX (120 * DB_NS_PER_S)

struct db_ids;

/* Which call it is. The texts need only live for the call that they are given to. */
struct db_id_key {
	uint32_t user;     /* of the process */
	const char *named; /* whom it acts for, shorter than DB_CLIENT_USER_MAX; "": not said */
	const char *drive; /* its name, at most 31 bytes; "": the gateway */
	const char *id;    /* 1 to DB_ID_MAX bytes */
};

/* One that was taken. */
struct db_id_call {
	uint64_t number;             /* its handle; never 0 */
	enum db_result result;       /* PENDING until it has ended */
	bool over;                   /* nothing is to come: its motion has ended, too */
	struct db_write_token token; /* by which its end is told */
	uint16_t drive;              /* as the registers number it now ... */
	uint32_t entry;              /* ... and the command's number in that drive's history */
};

/* Null without memory; freed with db_ids_free(), null is fine. */
struct db_ids *db_ids_new(void);
void db_ids_free(struct db_ids *ids);

/* Null: it is a new one. Valid until the next db_ids_add() or db_ids_drop(). */
struct db_id_call *db_ids_find(struct db_ids *ids, const struct db_id_key *key);

/* Keeps a new one, PENDING, at least until `until`. Null: there is no room, or no memory. Valid as above. */
struct db_id_call *db_ids_add(struct db_ids *ids, const struct db_id_key *key, db_time until,
                              db_time now);

/* By its handle; null: it was forgotten. Valid as above. */
struct db_id_call *db_ids_at(struct db_ids *ids, uint64_t number);

/* It was not begun after all: as good as never seen. */
void db_ids_drop(struct db_ids *ids, uint64_t number);

/* The end of one whose session does not wait for it any more; nothing where there is none with this token. */
void db_ids_end_by_token(struct db_ids *ids, struct db_write_token token, enum db_result result);

#endif
