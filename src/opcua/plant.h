/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What drivebridged tells: its drives and their registers, a stream of the values that are watched, others when they are
 * asked for, events and the figures of its buses. Connects by itself, again and again; when the drives change, they
 * are found again, and those that did not change stay what they are.
 *
 * One thread. Never waits, but for db_opcua_plant_fetch().
 */
#ifndef DRIVEBRIDGE_OPCUA_PLANT_H
#define DRIVEBRIDGE_OPCUA_PLANT_H

#include "drivebridge/time.h"
#include "opcua/config.h"
#include "opcua/model.h"

#include <poll.h>

struct db_opcua_plant;

/* All objects stay the plant's. */
struct db_opcua_plant_ops {
	/* A drive is there; `description` of the interface's type Drive, an empty object for the gateway. */
	void (*added)(void *context, struct db_opcua_drive *drive, const json_t *description);
	/* ... is another one of that name instead of `before`, which nothing may keep ... */
	void (*replaced)(void *context, const struct db_opcua_drive *before,
	                 struct db_opcua_drive *drive, const json_t *description);
	/* ... and is no more: nothing may keep it. */
	void (*removed)(void *context, struct db_opcua_drive *drive);
	/* The buses, of the interface's type Bus, when they are others than before. */
	void (*buses)(void *context, json_t *buses);
	/* By bus. */
	void (*figures)(void *context, json_t *buses);
	void (*event)(void *context, const json_t *event);
};

/* `config` must outlive it. NULL without memory; freed with db_opcua_plant_free(), NULL is allowed. */
struct db_opcua_plant *db_opcua_plant_new(const struct db_opcua_config *config,
                                          const struct db_opcua_plant_ops *ops, void *context);
void db_opcua_plant_free(struct db_opcua_plant *plant);

#define DB_OPCUA_PLANT_FDS 3

/* For poll(): places without a connection have fd -1. */
void db_opcua_plant_watch(const struct db_opcua_plant *plant,
                          struct pollfd fds[DB_OPCUA_PLANT_FDS]);

/* When db_opcua_plant_handle() is to be called without anything being ready. */
db_time db_opcua_plant_due(const struct db_opcua_plant *plant);

/* Does what is to be done. `us`: microseconds since 1970-01-01 UTC. */
void db_opcua_plant_handle(struct db_opcua_plant *plant, db_time now, int64_t us);

/*
 * Sees to it that the item's value is not older than the configuration's interval, or than what was last
 * commanded: asks the service for its group if it is, and waits some milliseconds at most. A service that is slow
 * is left alone for a while; then the value is what it was.
 */
void db_opcua_plant_fetch(struct db_opcua_plant *plant, struct db_opcua_item *item);

/* A token of the service's clock, of now. Waits as db_opcua_plant_fetch() does. False: there is none. */
bool db_opcua_plant_ask_clock(struct db_opcua_plant *plant, char token[DB_OPCUA_TOKEN_MAX]);

/* Somebody commanded the drive: what is known of it is older than that. */
void db_opcua_plant_outdate(struct db_opcua_drive *drive);

/* Registers are watched by others than before (struct db_opcua_item, watchers). */
void db_opcua_plant_rewatch(struct db_opcua_plant *plant);

/* The drive of this name, NULL when there is none. */
struct db_opcua_drive *db_opcua_plant_find(const struct db_opcua_plant *plant, const char *name);

#endif
