/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Named positions: where drives stood when somebody taught them. Each says on which drive, with which
 * scale and from which origin it was taught, so that a drive does not go to a place that has moved.
 *
 * The list and its text. Pure but for memory; one thread.
 */
#ifndef DRIVEBRIDGE_POSITIONS_H
#define DRIVEBRIDGE_POSITIONS_H

#include "drivebridge/axis.h"
#include "drivebridge/client.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* All of a gateway, and those of one drive. */
#define DB_POSITIONS_MAX 1024
#define DB_POSITIONS_OF_DRIVE 32

#define DB_POSITION_DRIVE_MAX 64
#define DB_POSITION_NAME_MAX 33 /* with the terminating zero */
#define DB_POSITION_ORIGIN_MAX 64

struct db_position {
	char drive[DB_POSITION_DRIVE_MAX]; /* its name in the configuration */
	char name[DB_POSITION_NAME_MAX];
	int32_t counts; /* drive units */
	double counts_per_unit;
	char identity[DB_IDENTITY_MAX + 1]; /* as the drive reports it; "": it reports none */
	/* What the position is counted from: the same text means that nothing has moved the
	 * origin. */
	char origin[DB_POSITION_ORIGIN_MAX];
	bool homed;         /* the drive had been homed, and its origin was not set by hand since */
	uint64_t taught_us; /* since 1970-01-01 UTC */
	char by[DB_CLIENT_TEXT_MAX]; /* who taught it, in words */
};

/* The drive as it is now. */
struct db_position_drive {
	bool online;
	bool stands;
	bool lost;  /* the origin, or it may have been: the drive or the power was away */
	bool homed; /* as above */
	int32_t position;
	double counts_per_unit; /* 0: not known yet */
	bool identified;        /* its identity is valid */
	char identity[DB_IDENTITY_MAX + 1];
	char origin[DB_POSITION_ORIGIN_MAX];
};

/* Why a drive may not go to a position. */
enum db_position_flaw {
	DB_POSITION_GOOD,
	DB_POSITION_OFFLINE,     /* the drive does not answer, or its parameters are not read yet */
	DB_POSITION_OTHER_DRIVE, /* another drive is at its place */
	DB_POSITION_OTHER_SCALE, /* its counts per unit are others */
	DB_POSITION_ORIGIN_LOST, /* the drive does not know where it stands */
	DB_POSITION_OTHER_ORIGIN, /* it counts from another origin, or may do so */
	DB_POSITION_FLAWS
};
struct db_position_flaw_row {
	/* "", "offline", "other_drive", "other_scale", "origin_lost", "other_origin" */
	const char *name;
	/* a sentence without its end for people, with what to do; "" for a good one */
	const char *text;
};
extern const struct db_position_flaw_row db_position_flaws[DB_POSITION_FLAWS];

enum db_position_flaw db_position_judge(const struct db_position *position,
                                        const struct db_position_drive *drive);

/* All zero: empty. What is in the list moves when one is put or removed. */
struct db_positions {
	struct db_position *list; /* in the order in which they were first taught */
	size_t count;
};

void db_positions_clear(struct db_positions *positions);

/* Null: there is none. */
struct db_position *db_positions_find(const struct db_positions *positions, const char *drive,
                                      const char *name);

/* Adds a copy, in the place of one with the same drive and name. 0, -ENOSPC (there are as many as
 * there may be) or -ENOMEM. */
int db_positions_put(struct db_positions *positions, const struct db_position *position);
/* False: there is none. */
bool db_positions_remove(struct db_positions *positions, const char *drive, const char *name);

/* As JSON, ending with a line feed, to be freed; null without memory. */
char *db_positions_write(const struct db_positions *positions);
/* Reads that into an empty list. 0, -ENOMEM, or -EINVAL: it is not such a text, and the list stays
 * empty. */
int db_positions_read(struct db_positions *positions, const char *text);

#endif
