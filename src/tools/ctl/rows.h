/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which samples a record has: all from the first one, or from some time before a trigger; and where
 * it ends. The samples before a trigger are stored here. Times are those of the data, in
 * microseconds. Pure but for jansson's memory.
 */
#ifndef DRIVEBRIDGE_CTL_ROWS_H
#define DRIVEBRIDGE_CTL_ROWS_H

#include "capture/trigger.h"

/* Most samples stored before a trigger; older ones are dropped, however long --before is. */
#define DB_CTL_ROWS_HELD 100000

struct db_ctl_rows {
	/* Set by the user before the first sample. */
	const char *trigger_drive; /* NULL: no trigger */
	struct db_capture_trigger *trigger;
	json_int_t before_us;   /* samples older than this before the trigger are dropped */
	json_int_t duration_us; /* from the trigger or the first sample on; 0: no limit */
	json_int_t samples_max; /* 0: no limit */
	/* Called for each sample of the record, in the order of arrival. */
	void (*write)(void *context, const json_t *sample, json_int_t time_us);
	void *context;

	/* Private; zeros at first. */
	json_t **held; /* a ring */
	size_t held_first;
	size_t held_count;
	bool begun;
	bool ended;
	json_int_t zero_us; /* time of the trigger, or of the first sample */
	json_int_t written;
};

/* A sample of the interface's type Sample. False: no memory. */
bool db_ctl_rows_take(struct db_ctl_rows *rows, json_t *sample);
/* Drops the stored samples. */
void db_ctl_rows_clear(struct db_ctl_rows *rows);

#endif
