/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Calls with an id chosen by the caller, and their results: so that the same call, repeated over
 * another connection or by a restarted tool, is carried out once. Ids are separate for each drive
 * and each user: the process's user, and for whom it acts.
 *
 * Bounded: the latest DB_IDS_EACH ids of each drive, in one block that is allocated with the
 * drive's first one. An id is not forgotten before its time is over; a user with too many is
 * refused.
 *
 * Pure but for that memory; time is passed in. Network thread only. Internal to src/bridge/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_IDS_H
#define DRIVEBRIDGE_CONTROL_IDS_H

#include "drivebridge/client.h"
#include "drivebridge/result.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Maximum length of an id in bytes, at least 1. */
#define DB_ID_MAX 64

/* Number of ids kept for each drive, and of drives that have some. */
#define DB_IDS_EACH 64
#define DB_IDS_OF_USER 48 /* at most, so that one user leaves places for others */
#define DB_IDS_DRIVES 256

/* The longest time that a call may wait, and how long its id is kept by default. */
#define DB_IDS_TIME_MAX (120 * DB_NS_PER_S)

/* All zero at first. */
struct db_ids {
	uint64_t added;
	struct db_id_block *blocks[DB_IDS_DRIVES]; /* null from the first unused one on */
};

/* All zero again. */
void db_ids_clear(struct db_ids *ids);

/* Identifies a call. The texts need only be valid during the function call. */
struct db_id_key {
	uint32_t user;     /* user of the process */
	const char *named; /* for whom it acts, shorter than DB_CLIENT_USER_MAX; "": not stated */
	const char *drive; /* its name, at most 31 bytes; "": the gateway */
	const char *id;    /* 1 to DB_ID_MAX bytes */
};

/* A call that was accepted. */
struct db_id_call {
	uint64_t number;             /* its handle; never 0 */
	enum db_result result;       /* PENDING until it has ended */
	bool over;                   /* finished: its motion has ended, too */
	struct db_write_token token; /* token by which its end is reported */
	uint16_t drive;              /* its present number in the registers ... */
	uint32_t entry;              /* ... and the command's number in that drive's history */
};

/* Null: the call is new. Valid until the next db_ids_add() or db_ids_drop(). */
struct db_id_call *db_ids_find(struct db_ids *ids, const struct db_id_key *key);

/* Stores a new call, PENDING, at least until `until`. Null: there is no room, or no memory. Valid
 * as above. */
struct db_id_call *db_ids_add(struct db_ids *ids, const struct db_id_key *key, db_time until,
                              db_time now);

/* Finds a call by its handle; null: it was forgotten. Valid as above. */
struct db_id_call *db_ids_at(struct db_ids *ids, uint64_t number);

/* The call was not begun after all: its id counts as never seen. */
void db_ids_drop(struct db_ids *ids, uint64_t number);

/* Records the end of a call for which its session no longer waits; no effect where none has this
 * token. */
void db_ids_end_by_token(struct db_ids *ids, struct db_write_token token, enum db_result result);

#endif
