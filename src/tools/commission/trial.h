/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive's data during a trial: samples in the order of their time, and the figures measured in
 * them.
 *
 * Pure but for its memory.
 */
#ifndef DRIVEBRIDGE_COMMISSION_TRIAL_H
#define DRIVEBRIDGE_COMMISSION_TRIAL_H

#include <stdbool.h>
#include <stddef.h>

/* Milliseconds count from the moment at which the command was sent. Position in counts, velocity as
 * the drive reports it: counts/s, rpm on servo-can. */
struct db_trial_sample {
	double ms;
	double position;
	double velocity;
	bool online;
	bool enabled;
	bool moving;
	double late_ms; /* time from its measurement to its arrival here */
};

struct db_trial {
	struct db_trial_sample *samples;
	size_t count;
	size_t room;
	double ended_ms; /* the stop or the last keep-alive was sent; below 0: neither */
};

/* Times are below 0 if the event was not seen. */
struct db_trial_figures {
	double began_ms;        /* the first sample whose position has changed */
	double shown_moving_ms; /* the first sample with the status moving */
	double way;             /* from the first position to the last */
	double speed;           /* counts/s, from positions, between the begin and the end */
	double told;            /* mean of the velocities reported meanwhile */
	/* from the end to the first sample after which it stays slower than nine tenths of that */
	double slowed_ms;
	double stood_ms;  /* from the end to the last change of the position */
	double shown_ms;  /* from the end to the first sample after which its status was standing */
	double stop_way;  /* counts after the end */
	double span;      /* largest difference of two positions */
	bool ever_moving; /* by its status */
	bool lost_power;  /* it had power while it moved, and none at the end */
};

/* False without memory. Samples that are older than the one before are left out. */
bool db_trial_add(struct db_trial *trial, const struct db_trial_sample *sample);

/* The longest time without a sample, if it is much longer than usual in this trial; 0: none. Then
 * the service or this program was not scheduled for a while, or answers were lost. */
double db_trial_find_hole(const struct db_trial *trial);

/* Up to two counts to and fro count as no motion. */
#define DB_TRIAL_DITHER 2.0

void db_trial_measure(const struct db_trial *trial, struct db_trial_figures *figures);

void db_trial_clear(struct db_trial *trial);

#endif
