/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a record waits for: "feeder.axis_state=ErrorStop", "feeder.position>10000", "feeder.status=error". It comes when
 * the condition becomes true behind a sample in which it was not: a state that is entered, a value that crosses
 * another, an edge of a bit. Pure.
 */
#ifndef DRIVEBRIDGE_CTL_TRIGGER_H
#define DRIVEBRIDGE_CTL_TRIGGER_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

enum db_ctl_relation { DB_CTL_EQUAL, DB_CTL_UNEQUAL, DB_CTL_ABOVE, DB_CTL_BELOW };

struct db_ctl_trigger {
	char drive[64];
	char name[64];
	enum db_ctl_relation relation;
	bool bits; /* =: all of `mask` are set; !=: not all */
	json_int_t mask;
	double value;
	bool known; /* there was a sample with this value */
	bool met;   /* in that */
};

/* "feeder.position>10000": cuts it in its parts; the value stays text. NULL, or what is wrong in words. */
const char *db_ctl_trigger_split(const char *text, struct db_ctl_trigger *trigger,
                                 const char **value);

/* The value, for that register. False with what would be right in `problem`. */
bool db_ctl_trigger_set(struct db_ctl_trigger *trigger, const json_t *reg, const char *value,
                        char *problem, size_t size);

/* The values of a sample of its drive: whether it comes with it. What is not known counts as not met. */
bool db_ctl_trigger_take(struct db_ctl_trigger *trigger, const json_t *values);

#endif
