/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives of the address space, as the plant (client/plant.h) shows them: the watched values
 * come as a stream, other values when they are read. When the drives change, unchanged ones are
 * kept.
 *
 * One thread. Never waits, except in db_opcua_plant_fetch() and functions that ask.
 */
#ifndef DRIVEBRIDGE_OPCUA_PLANT_H
#define DRIVEBRIDGE_OPCUA_PLANT_H

#include "client/plant.h"
#include "opcua/config.h"
#include "opcua/model.h"

struct db_opcua_plant;

/* All objects stay the plant's. */
struct db_opcua_plant_ops {
	/* A drive was added; `description` of the interface's type Drive, an empty object for the
	 * gateway. */
	void (*added)(void *context, struct db_opcua_drive *drive, const json_t *description);
	/* ... was replaced by another one of that name; nothing may keep `before` ... */
	void (*replaced)(void *context, const struct db_opcua_drive *before,
	                 struct db_opcua_drive *drive, const json_t *description);
	/* ... and was removed: nothing may keep it. */
	void (*removed)(void *context, const struct db_opcua_drive *drive);
	/* All of these have been told that came and went together. */
	void (*settled)(void *context);
	/* The buses, of the interface's type Bus, when they have changed. */
	void (*buses)(void *context, json_t *buses);
	/* By bus. */
	void (*figures)(void *context, json_t *buses);
	/* What is wrong with buses: records by their names. A drive's record is in its
	 * diagnosis. */
	void (*troubles)(void *context, json_t *buses);
	/* Alarms, of the interface's type Alarm; `first`: all there are follow. */
	void (*alarms)(void *context, const json_t *answer, bool first);
	void (*event)(void *context, const json_t *event);
};

/* `config` must outlive it. NULL without memory; freed with db_opcua_plant_free(), NULL is
 * allowed. */
struct db_opcua_plant *db_opcua_plant_new(sd_event *loop, const struct db_opcua_config *config,
                                          const struct db_opcua_plant_ops *ops, void *context);
void db_opcua_plant_free(struct db_opcua_plant *plant);

/* Does the work that is due; returns when it is to be called next without an answer. */
db_time db_opcua_plant_tend(struct db_opcua_plant *plant, db_time now);

/* True if the drives have been found once. */
bool db_opcua_plant_is_known(const struct db_opcua_plant *plant);

/* True if the service takes what is for its audit trail. */
bool db_opcua_plant_has_audit(const struct db_opcua_plant *plant);
/* Adds to the audit trail what a user did here. */
void db_opcua_plant_note(const struct db_opcua_plant *plant, const struct db_plant_note *note);

/* As db_plant_is_stop(). */
bool db_opcua_plant_is_stop(const struct db_opcua_plant *plant, const char *command);

/*
 * Ensures that the item's value is not older than the configured interval, or than the last
 * command: if it is, asks the service for its group, and waits some milliseconds at most. A slow
 * service is not asked again for a while; then the value stays as it was.
 */
void db_opcua_plant_fetch(struct db_opcua_plant *plant, struct db_opcua_item *item);

/* A current token of the service's clock. Waits as db_opcua_plant_fetch() does. False: there is
 * none. */
bool db_opcua_plant_ask_clock(struct db_opcua_plant *plant, char token[DB_OPCUA_TOKEN_MAX]);

/* How the drive was since then, an answer to the service's method Health, waiting as long; NULL:
 * there is none, or it came too late. */
json_t *db_opcua_plant_ask_health(struct db_opcua_plant *plant, const char *drive, int64_t since_us,
                                  int wait_ms);

/* The drive got a command: the known values are older than that. */
void db_opcua_plant_outdate(struct db_opcua_drive *drive);

/* The watched registers have changed (struct db_opcua_item, watchers). */
void db_opcua_plant_rewatch(struct db_opcua_plant *plant);

/* The drive of this name, NULL when there is none. */
struct db_opcua_drive *db_opcua_plant_find(const struct db_opcua_plant *plant, const char *name);

#endif
