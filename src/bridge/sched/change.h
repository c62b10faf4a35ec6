/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that are removed from a bus and drives that are added to it while it runs. Internal to
 * src/bridge/sched.
 *
 * The network thread makes a change that contains everything the bus will need, and frees it
 * together with everything the bus no longer needs: the cyclic path allocates nothing.
 */
#ifndef DRIVEBRIDGE_SCHED_CHANGE_H
#define DRIVEBRIDGE_SCHED_CHANGE_H

#include "sched/sched_private.h"

/* Longest wait for drives to confirm their on_exit. */
#define DB_EXIT_TIME (1500 * DB_NS_PER_MS)

struct db_change {
	/* a drive that has not confirmed its on_exit by then is removed all the same */
	db_time leave_by;
	size_t leaving_count;
	uint16_t *leaving;
	struct station **removed; /* so far; freed with the change */
	size_t removed_count;
	struct station **coming; /* freed with the change if they were not added */
	size_t coming_count;
	/* Arrays for all stations and nodes after the change; afterwards the engine's former
	 * arrays. */
	struct station **stations;
	struct node **nodes;
};

/* `present`: the number of drives at the bus now. Null when out of memory. */
struct db_change *change_new(const struct db_bus_config *bus, size_t present,
                             const uint16_t *leaving, size_t leaving_count,
                             const struct db_bus_drive *coming, size_t coming_count);
void change_free(struct db_change *change);

/* Bus thread: drives that leave are told to stop. The engine owns the change until it was carried
 * out and fetched; that must happen before the next one. */
void change_begin(struct db_engine *engine, struct db_change *change, db_time now);
/* Removes the drives that can leave now; when none is left to be removed, adds the new ones. */
void change_carry_out(struct db_engine *engine, db_time now);
/* A change that was carried out, or null. */
struct db_change *change_fetch(struct db_engine *engine);

#endif
