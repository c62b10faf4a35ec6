/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the drives have been: round trips, retries, losses and temperatures of the last week, and the
 * alarms with what became of them. Both are kept in files over restarts.
 *
 * The network thread adds figures that the buses count anyway. A thread of its own writes and reads
 * the file of the values, because a disk may take seconds. Without a folder, or while the disk does
 * not take them, values are in memory that is no heap, and alarms are on the heap.
 *
 * All functions are the network thread's.
 */
#ifndef DRIVEBRIDGE_HEALTH_H
#define DRIVEBRIDGE_HEALTH_H

#include "drivebridge/axis.h"
#include "drivebridge/log.h"
#include "drivebridge/time.h"
#include "drivebridge/trouble.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct db_health;

/* Names in the configuration have 31 characters at most. */
#define DB_HEALTH_NAME_MAX 32

struct db_health_setup {
	struct db_log_source log; /* for trouble with the files */
	const char *folder;       /* where the files are, made if need be; null: nowhere */
	bool on;
};

/* Reads the alarms and starts the thread. 0 or a negative errno. */
int db_health_new(const struct db_health_setup *setup, db_time now, struct db_health **health);
/* Writes the interval that has not ended, and the alarms, for a second at most. Null is fine. False:
 * the disk still holds up the thread, which goes on using the log until the process ends. */
bool db_health_free(struct db_health *health, db_time now, uint64_t wall_us);
/* Off: no values are taken, and nothing is written or read. */
void db_health_change(struct db_health *health, bool on);

struct db_health_state {
	bool on;
	bool kept;         /* in files */
	char trouble[128]; /* why they cannot be written at present; "" */
};
void db_health_state(struct db_health *health, struct db_health_state *state);

/* --- values ----------------------------------------------------------------------------------- */

/* Intervals end after this time; the first one after a start sooner, so that a service that is
 * restarted again and again leaves values. */
#define DB_HEALTH_INTERVAL_S 60
#define DB_HEALTH_FIRST_S 5

#define DB_HEALTH_DRIVES_MAX 247

/* Drives are the same in another run, or after a reload, when name and unit are. */
struct db_health_drive {
	const char *name;
	uint16_t unit;
	uint16_t number; /* another one when its counters have begun anew */
};

/* The drives from now on, which are counted from here. The interval goes on for those that were
 * there before. 0 or -ENOMEM: then they are the former ones. */
int db_health_set_drives(struct db_health *health, const struct db_health_drive *drives,
                         size_t count);
/* What the drive at this place does now. Called several times in a second. `has_temperature`: its
 * family reports it. */
void db_health_sample(struct db_health *health, size_t place, const struct db_snapshot *snapshot,
                      bool has_temperature, db_time now);
/* Called several times in a second, after the samples: ends the interval when it is due, and has
 * alarms written. `wall_us`: since 1970-01-01 UTC. */
void db_health_tick(struct db_health *health, db_time now, uint64_t wall_us);

/* Values of one drive in their order, or of each drive one value over all the time. */
struct db_health_query {
	char drive[DB_HEALTH_NAME_MAX]; /* "": each */
	uint64_t since_us;              /* since 1970-01-01 UTC; 0: everything that is kept */
	/* 60, 900 or 3600; 0: the finest that goes back as far */
	uint32_t step_s;
	bool rows; /* with "": of each drive a row of figures instead */
};

struct db_health_page {
	char *values; /* members of a JSON array, with `rows` of an object; to be freed; null: none */
	size_t length;
	bool known; /* there are values of this drive */
	uint32_t step_s;
};

/* Begins to read; false: another owner's page is being read. By the clocks given, times that a wrong
 * clock gave to values of this run are corrected. */
bool db_health_ask(struct db_health *health, uint32_t owner, const struct db_health_query *query,
                   db_time now, uint64_t wall_us);
/* False: it is not there yet. */
bool db_health_take(struct db_health *health, uint32_t owner, struct db_health_page *page);
/* The owner is gone. */
void db_health_forget(struct db_health *health, uint32_t owner);

/* The interval that has not ended, of one drive or (with "") of all: members of a JSON array, to be
 * freed; null: no memory. */
char *db_health_running(const struct db_health *health, const char *drive, db_time now,
                        uint64_t wall_us);

/* --- alarms ----------------------------------------------------------------------------------- */

enum db_alarm_kind { DB_ALARM_DRIVE, DB_ALARM_BUS, DB_ALARM_CONFIGURATION, DB_ALARM_KIND_COUNT };
const char *db_alarm_kind_name(enum db_alarm_kind kind); /* "drive" ... */

#define DB_ALARM_DETAIL_MAX 64
#define DB_ALARM_BY_MAX 128
/* When there are more, the oldest ones go that are gone and acknowledged; then those gone. */
#define DB_ALARMS_MAX 500

/* A trouble, with what became of it. Times are since 1970-01-01 UTC. */
struct db_alarm {
	uint64_t id;           /* from 1, also over restarts */
	uint64_t change;       /* greater than that of all that changed before */
	uint64_t since;        /* microseconds: when it came first */
	uint64_t came;         /* ... and last */
	uint64_t gone;         /* 0: it has not ended */
	uint64_t acknowledged; /* 0: it is not */
	uint32_t times; /* how often it came before it was acknowledged, or within a minute */
	uint8_t kind;   /* enum db_alarm_kind */
	uint8_t cause;  /* enum db_trouble_cause; CONFIGURATION: enum db_configuration_state */
	char name[DB_HEALTH_NAME_MAX];    /* of the drive or bus; "": the configuration */
	char detail[DB_ALARM_DETAIL_MAX]; /* such as the name of the fault; "" */
	char by[DB_ALARM_BY_MAX];         /* who has acknowledged it */
};

/* A trouble that is there now. */
struct db_alarm_seen {
	enum db_alarm_kind kind;
	uint8_t cause;
	const char *name;
	const char *detail;
	uint64_t since_us;
};

/* All troubles that are there, one by one, and then the end of them: the others are gone. */
void db_health_see(struct db_health *health, const struct db_alarm_seen *seen);
void db_health_seen(struct db_health *health, uint64_t wall_us);

/* All of them. The list is valid until the next call of a function above. */
struct db_alarm_list {
	const struct db_alarm *alarms; /* in the order of their ids */
	size_t count;
	uint64_t last_change; /* the greatest `change` of all; 0: none */
};
struct db_alarm_list db_health_alarms(const struct db_health *health);

/* The alarm of this id, which is acknowledged afterwards; one that was already stays as it is, and
 * *fresh is false. Null: there is none, or it is not of this drive ("": of whatever it is). */
const struct db_alarm *db_health_acknowledge(struct db_health *health, uint64_t id,
                                             const char *drive, const char *by, uint64_t wall_us,
                                             bool *fresh);

#endif
