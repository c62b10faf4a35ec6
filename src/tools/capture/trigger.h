/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The condition that starts a record: "feeder.axis_state=ErrorStop", "feeder.position>10000",
 * "feeder.status=error". It triggers when a sample fulfils the condition and the one before did
 * not: a state is entered, a value crosses a limit, a bit changes. Pure.
 */
#ifndef DRIVEBRIDGE_CAPTURE_TRIGGER_H
#define DRIVEBRIDGE_CAPTURE_TRIGGER_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

enum db_capture_relation {
	DB_CAPTURE_EQUAL,
	DB_CAPTURE_UNEQUAL,
	DB_CAPTURE_ABOVE,
	DB_CAPTURE_BELOW
};

struct db_capture_trigger {
	char drive[64];
	char name[64];
	enum db_capture_relation relation;
	bool bits; /* =: all bits of `mask` are set; !=: not all */
	json_int_t mask;
	double value;
	bool known; /* there was an earlier sample with this value */
	bool met;   /* the earlier sample met the condition */
};

/* Splits "feeder.position>10000" into its parts; the value stays text. NULL, or the mistake in
 * words. */
const char *db_capture_trigger_split(const char *text, struct db_capture_trigger *trigger,
                                     const char **value);

/* Parses the value for that register. False with what would be right in `problem`. */
bool db_capture_trigger_set(struct db_capture_trigger *trigger, const json_t *reg,
                            const char *value, char *problem, size_t size);

/* Takes the values of a sample of its drive: true if it triggers. An unknown value counts as not
 * met. */
bool db_capture_trigger_take(struct db_capture_trigger *trigger, const json_t *values);

#endif
