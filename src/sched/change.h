/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that leave a bus and drives that come to it while it runs. Internal to src/sched.
 *
 * The network thread makes a change with everything in it that the bus will need and frees it with
 * everything the bus does not need any more: the cyclic path allocates nothing.
 */
#ifndef DRIVEBRIDGE_SCHED_CHANGE_H
#define DRIVEBRIDGE_SCHED_CHANGE_H

#include "sched/station.h"

/* Longest time in which drives are waited for to confirm their on_exit. */
#define DB_EXIT_TIME (1500 * DB_NS_PER_MS)

struct db_change {
	db_time leave_by; /* who has not confirmed its on_exit by then leaves all the same */
	size_t leaving_count;
	uint16_t *leaving;
	struct station **left; /* so far, to be freed */
	size_t left_count;
	struct station **coming; /* to be freed as long as they have not come */
	size_t coming_count;
	/* Room for all stations and nodes in the end; the engine's former room afterwards. */
	struct station **stations;
	struct node **nodes;
};

/* `present`: how many drives there are at the bus now. Null when out of memory. */
struct db_change *change_new(const struct db_bus_config *bus, size_t present,
                             const uint16_t *leaving, size_t leaving_count,
                             const struct db_bus_drive *coming, size_t coming_count);
void change_free(struct db_change *change);

/* Bus thread: who leaves is told to stop. The change is the engine's until it was carried out and fetched;
 * before the next one it must be. */
void change_begin(struct db_engine *engine, struct db_change *change, db_time now);
/* Takes out who can leave now; when nobody leaves any more, takes in who comes. */
void change_carry_out(struct db_engine *engine, db_time now);
/* When it is to be looked at again at the latest; DB_TIME_NEVER. */
db_time change_deadline(const struct db_engine *engine, db_time now);
/* One that was carried out, or null. */
struct db_change *change_fetch(struct db_engine *engine);

#endif
