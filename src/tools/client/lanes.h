/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lanes: connections over which a tool commands drives, in addition to those of its plant. For the
 * service each lane is a client, with control of drives and with their watchdogs; a stop goes past
 * all of them (stops.h). Their number is limited. One thread.
 */
#ifndef DRIVEBRIDGE_CLIENT_LANES_H
#define DRIVEBRIDGE_CLIENT_LANES_H

#include "client/stops.h"
#include "drivebridge/time.h"

struct db_lanes;

/* The owner's fields are its own to write; the others are only read. */
struct db_lane {
	struct db_lanes *lanes;
	struct db_link *link; /* NULL: it is not open */
	struct db_lane_drive *drives;
	size_t count;   /* drives that were commanded over it */
	unsigned reads; /* of these drives, without an answer */
	/* The owner's: */
	unsigned session;
	bool shared;  /* drives are commanded together over it */
	db_time used; /* last */
	void *call;   /* allocated by the owner, freed when the lane is closed; NULL: none */
};

/* The error of a lane that cannot be opened because all are taken. */
#define DB_LANES_FULL "io.drivebridge.Client.Full"

struct db_lanes_form {
	const char *socket;
	size_t most;  /* lanes at the same time */
	size_t stops; /* without an answer at the same time, as for db_stops_new() */
	/* Longest time between two reads of a drive; 0: each db_lane_feed() reads. */
	db_time interval;
	/* The connection is lost, and all its calls have been answered with that: the owner is to
	 * close the lane. NULL: it is closed already, and `call` is freed. */
	void (*lost)(void *context, struct db_lane *lane);
	/* What was read of a drive. True: it is to be read again, whatever its watchdog says. NULL:
	 * nothing needs it. */
	bool (*seen)(void *context, struct db_lane *lane, const char *drive, const json_t *values);
};

/* The form's texts must outlive it. NULL without memory; freed with db_lanes_free(). */
struct db_lanes *db_lanes_new(sd_event *loop, const struct db_lanes_form *form, void *context);

/* As db_lanes_drop(). NULL is allowed. */
void db_lanes_free(struct db_lanes *lanes);

/* Closes all, without answers to waiting calls; waiting stops are answered with DB_CLIENT_LOST.
 * True if there were any. */
bool db_lanes_drop(struct db_lanes *lanes);

/* Those that go past the lanes. */
struct db_stops *db_lanes_stops(struct db_lanes *lanes);

/* NULL with an error. It belongs to the lanes, and stays where it is until it is closed. */
struct db_lane *db_lanes_open(struct db_lanes *lanes, struct db_client_error *error);

/* The next open one after `lane`; NULL: the first one. NULL at the end. */
struct db_lane *db_lanes_next(struct db_lanes *lanes, const struct db_lane *lane);

/* For the service its client is gone. Waiting calls are answered with DB_CLIENT_LOST before this
 * returns. NULL is allowed. */
void db_lane_close(struct db_lane *lane);

/* The same without these answers: calls under way go on in the service. */
void db_lane_drop(struct db_lane *lane);

/* --- watchdogs -------------------------------------------------------------------------------- */

/* A drive is commanded over this lane; NULL: each that was before. False: there is no room for a
 * further one. */
bool db_lane_command(struct db_lane *lane, const char *drive, db_time now);

/* A place for an object of the owner about a drive that was commanded over this lane, freed with
 * it; NULL: it was not. */
json_t **db_lane_note(struct db_lane *lane, const char *drive);

/*
 * Whoever commands over this lane is alive. Reads its drives that are due, which feeds their
 * watchdogs and keeps control of them: while one of both would end something, and for some seconds
 * after a command. Not while another call waits, whose end the read would have to wait for.
 */
void db_lane_feed(struct db_lane *lane, db_time now);

/* When the next drive is due; DB_TIME_NEVER: none. */
db_time db_lanes_due(const struct db_lanes *lanes);

#endif
