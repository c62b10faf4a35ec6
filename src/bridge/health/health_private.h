/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the room for each other.
 */
#ifndef DRIVEBRIDGE_HEALTH_HEALTH_PRIVATE_H
#define DRIVEBRIDGE_HEALTH_HEALTH_PRIVATE_H

#include "drivebridge/health.h"

#include <stdio.h>

/* --- bytes.c ---------------------------------------------------------------------------------- */

/* Numbers in files, the lowest byte first. Pure. */

void db_bytes_put(uint8_t *bytes, uint64_t number, unsigned size);
uint64_t db_bytes_get(const uint8_t *bytes, unsigned size);
/* CRC-32 as in IEEE 802.3. */
uint32_t db_bytes_crc(const uint8_t *bytes, size_t size);

/* --- value.c ---------------------------------------------------------------------------------- */

/*
 * What is known of one drive over an interval, and as it is in the file: 16 bytes, in which numbers
 * from 2048 on are rounded down by less than 0.1 %. Pure.
 */

#define DB_HEALTH_NO_TEMPERATURE INT8_MIN

struct db_health_value {
	bool known; /* the drive was there */
	uint32_t exchanges;
	uint32_t retries;
	uint32_t losses;  /* exchanges without an answer in time */
	uint32_t damaged; /* frames whose checksum or form was wrong */
	uint32_t mean_us; /* of the round trips; 0: there was none */
	uint32_t longest_us;
	uint32_t offline_ms;
	int8_t coldest; /* degrees Celsius; DB_HEALTH_NO_TEMPERATURE: not reported */
	int8_t hottest;
};

#define DB_HEALTH_VALUE_BYTES 16

void db_health_value_write(const struct db_health_value *value,
                           uint8_t bytes[DB_HEALTH_VALUE_BYTES]);
void db_health_value_read(const uint8_t bytes[DB_HEALTH_VALUE_BYTES],
                          struct db_health_value *value);

/* Both intervals together, in the first one. */
void db_health_value_add(struct db_health_value *sum, const struct db_health_value *value);

/* As the varlink definition has it; `end_us`: when its interval ended. */
void db_health_value_print(const struct db_health_value *value, const char *drive, uint64_t end_us,
                           uint64_t span_s, FILE *out);

/* --- meter.c ---------------------------------------------------------------------------------- */

/*
 * What is counted of a drive in the interval that goes on. The longest round trip is that of the
 * samples; of those in between, only one that was the longest since the drive was there is seen.
 * Pure.
 */

struct db_meter {
	char name[DB_HEALTH_NAME_MAX];
	uint16_t unit;
	uint16_t number; /* see struct db_health_drive */
	db_time sampled; /* when it was looked at last; 0: not yet */
	struct db_axis_stats last;
	struct db_health_value value; /* without mean_us and offline_ms */
	uint32_t answers;
	uint64_t sum_us; /* of their round trips */
	db_time offline;
};

/* Another interval begins. */
void db_meter_begin(struct db_meter *meter);
void db_meter_sample(struct db_meter *meter, const struct db_snapshot *snapshot,
                     bool has_temperature, db_time now);
void db_meter_read(const struct db_meter *meter, struct db_health_value *value);

/* --- ring.c ----------------------------------------------------------------------------------- */

/*
 * The form of the file. A head names the drives, each of which has a column. Behind it are three
 * rings of slots: for the last minutes, quarters of an hour, and hours. A slot has a value of each
 * drive and a checksum of its own. A slot is written in its place, over the oldest one, so that a
 * torn write costs that and nothing else. Intervals are numbered on over restarts; clocks are only
 * noted. Pure.
 */

enum db_ring { DB_RING_MINUTES, DB_RING_QUARTERS, DB_RING_HOURS, DB_RING_COUNT };

/* Intervals of the first ring in a slot of each, and their nominal seconds. */
extern const unsigned db_ring_widths[DB_RING_COUNT];

#define DB_RING_FILE_MAX (1024 * 1024)
#define DB_RING_COLUMNS_MAX DB_HEALTH_DRIVES_MAX

struct db_ring_shape {
	uint16_t columns;
	uint16_t slots[DB_RING_COUNT];
};

/* For this number of drives, 1 to DB_RING_COLUMNS_MAX, or some more. */
void db_ring_shape_for(size_t drives, struct db_ring_shape *shape);

size_t db_ring_head_bytes(const struct db_ring_shape *shape);
size_t db_ring_slot_bytes(const struct db_ring_shape *shape);
size_t db_ring_file_bytes(const struct db_ring_shape *shape);
/* Where the slot of this number is. */
size_t db_ring_place(const struct db_ring_shape *shape, enum db_ring ring, uint32_t number);

struct db_ring_column {
	char name[DB_HEALTH_NAME_MAX]; /* "": free */
	uint16_t unit;
	uint32_t since; /* number of the first interval that is this drive's */
};

/* The longest head: that of the most columns. */
#define DB_RING_HEAD_MAX (32 + DB_RING_COLUMNS_MAX * 40)

void db_ring_write_head(const struct db_ring_shape *shape, const struct db_ring_column *columns,
                        uint8_t *bytes);
/* False: it is none, or damaged. */
bool db_ring_read_head(const uint8_t *bytes, size_t size, struct db_ring_shape *shape,
                       struct db_ring_column columns[DB_RING_COLUMNS_MAX]);

/* What a slot says about itself. */
struct db_ring_slot {
	uint32_t number;  /* of the interval, by the width of its ring */
	uint32_t run;     /* of the service, from 1 */
	uint32_t clock_s; /* monotonic clock at its end */
	uint16_t span_s;  /* how long it lasted */
	uint64_t wall_us; /* since 1970-01-01 UTC, at its end */
};

#define DB_RING_SLOT_HEAD 28
#define DB_RING_SLOT_MAX (DB_RING_SLOT_HEAD + DB_RING_COLUMNS_MAX * DB_HEALTH_VALUE_BYTES)

/* Where the value of a column is in the bytes of a slot. */
uint8_t *db_ring_value_of(uint8_t *bytes, size_t column);
/* Every drive unknown. */
void db_ring_clear_slot(const struct db_ring_shape *shape, uint8_t *bytes);
/* The values are in their places. */
void db_ring_write_slot(const struct db_ring_shape *shape, enum db_ring ring,
                        const struct db_ring_slot *slot, uint8_t *bytes);
/* False: there is none yet, or it is damaged. */
bool db_ring_read_slot(const struct db_ring_shape *shape, enum db_ring ring, const uint8_t *bytes,
                       struct db_ring_slot *slot);

/* --- store.c ---------------------------------------------------------------------------------- */

/*
 * The rings in a file, or in memory of the kernel while there is none. The thread's own.
 */

struct db_store;

/* What was posted of one drive. */
struct db_store_entry {
	char name[DB_HEALTH_NAME_MAX];
	uint16_t unit;
	uint8_t value[DB_HEALTH_VALUE_BYTES];
};

struct db_store_interval {
	uint32_t clock_s;
	uint16_t span_s;
	uint64_t wall_us;
	const struct db_store_entry *entries;
	size_t count; /* DB_HEALTH_DRIVES_MAX at most */
};

/* What is added to the name of a file that is not understood, and begun anew. */
#define DB_HEALTH_DAMAGED ".damaged"

/* `folder` is made when something is written; null: only in memory. *damaged: there was a file that
 * is not understood. 0 or a negative errno: there is no memory. */
int db_store_open(const char *folder, struct db_store **store, bool *damaged);
void db_store_free(struct db_store *store);

/* Adds an interval. 0; or a negative errno: the file could not be written, and it is kept in
 * memory, from which the next one tries to write a file again. */
int db_store_add(struct db_store *store, const struct db_store_interval *interval);

/* The clocks now, by which times of this run are corrected. */
void db_store_read(struct db_store *store, const struct db_health_query *query, uint32_t clock_s,
                   uint64_t wall_us, struct db_health_page *page);

/* Puts a file in the place of another one: it has all of the bytes, or it is the former one. 0 or a
 * negative errno. */
int db_store_replace(const char *folder, const char *name, const void *bytes, size_t size);

/* --- alarms.c --------------------------------------------------------------------------------- */

/* The list of alarms, and its form in a file. Pure but for memory. */

struct db_alarms {
	struct db_alarm *list; /* in the order of their ids */
	bool *seen;            /* of each: it was seen since the last end */
	size_t count;
	size_t room;
	uint64_t last_id;
	uint64_t last_change; /* the greatest `change` of all; 0: none */
	bool changed;         /* something that is to be written */
	bool urgent;          /* ... soon */
};

void db_alarms_clear(struct db_alarms *alarms);
/* Without memory it is left out, and seen again. */
void db_alarms_see(struct db_alarms *alarms, const struct db_alarm_seen *seen);
void db_alarms_end(struct db_alarms *alarms, uint64_t wall_us);
/* As db_health_acknowledge(). */
const struct db_alarm *db_alarms_acknowledge(struct db_alarms *alarms, uint64_t id,
                                             const char *drive, const char *by, uint64_t wall_us,
                                             bool *fresh);

/* The bytes of the file, to be freed; null: no memory. */
uint8_t *db_alarms_write(const struct db_alarms *alarms, size_t *size);
/* Into an empty list. False: these bytes are none, or damaged, or there is no memory; then it stays
 * empty. */
bool db_alarms_read(struct db_alarms *alarms, const uint8_t *bytes, size_t size);

#endif
