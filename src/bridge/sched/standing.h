/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The record of a drive that must stand: which stop is sent, why, since when, and what was observed
 * since then.
 *
 * A stop opens the record; a second stop joins it, and the stronger kind wins. The record is closed
 * when the drive was seen to stand after the stop was sent, or when a later motion was carried out,
 * and by nothing else: not by an answer, an offline time or a closed port. Until then the stop is
 * repeated at intervals, unless the drive is seen to slow down: a drive that obeys is left alone,
 * because no document says what a second stop does to a ramp.
 *
 * A controller's stop stops all of its axes, its disable one. So such a stop is also sent where a
 * disable is stronger, in turn with it, and the record is kept until the controller has answered
 * it: that this axis stands shows nothing about the others.
 *
 * Only a sample counts whose request was sent after the stop. It shows how fast the drive is, not
 * how fast it should slow down: deceleration may take seconds, by the drive's own ramps, and is no
 * failure while it goes on. A drive that can be reached and does not slow down within `patience` is
 * reported as not stopping, even if no sample shows anything.
 *
 * Pure: samples and the time are passed in. Bus thread only; internal to src/bridge/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_STANDING_H
#define DRIVEBRIDGE_SCHED_STANDING_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"

#include <stdbool.h>

/* Drive units per second, without direction. */
struct standing_speed {
	float top;   /* the fastest since the record was opened */
	float least; /* the slowest since the fastest */
};

/* Over some time, because it is computed from positions. */
struct standing_window {
	db_time since; /* when its first position was read; 0: there is no window */
	int32_t position;
	float before;                /* speed in the window before; negative: there was none */
	struct standing_speed speed; /* of each two windows in a row */
};

struct standing {
	enum db_command kind; /* the strongest stop requested; NONE: the drive is free */
	unsigned kinds;       /* one bit per command: all stops requested */
	/* one bit per command: stops that the drive refused since the last one that it accepted */
	unsigned refused;
	unsigned causes;           /* one bit per enum db_stand_cause */
	enum db_stand_cause cause; /* the cause that joined last */
	uint32_t count;            /* number of stops sent */
	db_time since;
	db_time sent_at; /* when the last stop was sent; 0: none since a cause joined */
	db_time send_at; /* earliest time of the next stop */
	db_time backoff; /* pause after the next loss while the drive is offline */
	unsigned losses; /* consecutive losses of what was sent for the record */
	/* since the last cause joined, a stop was sent in the middle of another exchange, which
	 * proves nothing */
	bool interrupted;
	bool gives_way; /* a later motion that is under way may end the record */
	/* the drive answered the last stop itself: a slow-down is caused by this stop */
	bool acknowledged;
	bool confirmed; /* a disable was answered: it is known whether the power is off */

	/* One bit per command: stops that stop more than this drive, and those of them that it has
	 * not answered since they joined. */
	unsigned wide;
	unsigned owed;
	bool wide_was_last; /* the last stop sent was one of `wide` */

	/* the drive was not known to stand when the record was opened, or has moved since */
	bool may_move;
	bool obeys; /* seen to slow down or to stand since the last cause joined */
	/* a speed that is computed from two positions has fallen: no second stop is sent into what
	 * may be a ramp, but that proves nothing */
	bool slows;
	bool overdue;     /* the drive does not stop */
	bool read_since;  /* the drive was read since the last stop was sent */
	db_time read_at;  /* when to read it, without waiting for the cycle */
	db_time read_by;  /* wait until then for a sample before the stop is sent again */
	db_time progress; /* when it was last seen slower than before; 0: time does not count yet */
	struct standing_speed speed;   /* of each sample */
	struct standing_window window; /* where a speed is computed */
	bool speed_known;              /* two windows were seen */
	db_time unknown_since;         /* if not: time does not count from here on; 0: it counts */
	int32_t still_position;        /* its position at still_since */
	/* when it was first seen standing, in a row; 0: it moves, or was not seen */
	db_time still_since;
};

/* One part in this many of the wire's time is used for stops to a drive that does not answer. */
#define STANDING_LOSSES_SHARE 5

enum standing_verdict {
	STANDING_UNSEEN,  /* nothing is known yet */
	STANDING_OBEYS,   /* it slows down, or stands and must be seen standing once more */
	STANDING_DONE,    /* it stands: the record was closed */
	STANDING_RUNS_ON, /* the drive does not stop although it should */
};

/* The least patience with a speed that is computed from two positions: two windows are needed to
 * begin with, and two to see that it slows down. */
#define STANDING_PATIENCE_COMPUTED (800 * DB_NS_PER_MS)

/* Parameters for judging a sample. */
struct standing_rules {
	db_time patience; /* how long a drive may take to slow down */
	/* its velocity is computed from two positions, and is as wrong as their times are */
	bool computed;
	/* how long it must be seen standing, where a motion may begin late; 0: it cannot */
	db_time doubt;
};

static inline bool standing_is_free(const struct standing *standing)
{
	return standing->kind == DB_CMD_NONE;
}

/* True if no effect of the stop was seen yet: commands wait for it, and so does the shutdown. */
static inline bool standing_is_open(const struct standing *standing)
{
	return !standing_is_free(standing) && !standing->obeys;
}

/* True if the drive was read after the stop and stood; while the position keeps changing it does
 * not stand. */
static inline bool standing_is_seen_still(const struct standing *standing)
{
	return standing->obeys && standing->still_since != 0;
}

/* A cause joins. `known`: a fresh sample, or null when there is none. */
void standing_enter(struct standing *standing, enum db_command kind, enum db_stand_cause cause,
                    const struct db_feedback *known, db_time now);
/* The stop that has just joined is one of a controller with several axes, for all of them. */
void standing_owe(struct standing *standing, enum db_command kind);
/* Withdraws a cause; without another one the record is closed. */
void standing_withdraw(struct standing *standing, enum db_stand_cause cause);

/* When the next stop is due, if nothing else prevents it; DB_TIME_NEVER: the drive obeys, and
 * nothing more is sent. */
db_time standing_send_at(const struct standing *standing);
/* The stop to be sent next: the strongest kind that the drive has not refused, or the strongest one
 * when it has refused all; in turn with an owed stop, where the strongest is a disable. */
enum db_command standing_next(const struct standing *standing);

/* A stop was sent. `trusted`: its answer will prove something; otherwise it is repeated as soon as
 * an answer would. `round_trip`: duration of the drive's latest exchange. */
void standing_stop_sent(struct standing *standing, bool trusted, db_time round_trip, db_time now);
/* The conversation of the stop has ended; `taken`: the drive accepted it. `acknowledged`: by its
 * own answer. */
void standing_stop_answered(struct standing *standing, enum db_command command, bool taken,
                            bool acknowledged, db_time now);
/* A frame sent for the record was not answered, which used `cost` of the wire. True when the next
 * one must wait for its share of the wire. `online`: the rest of the scheduler takes the drive for
 * online. */
bool standing_stop_lost(struct standing *standing, bool online, unsigned retries, db_time cost,
                        db_time now);

/* The drive, or its port, is back: the stop is sent first of all, and earlier observations do not
 * count. */
void standing_resume(struct standing *standing, db_time now);
/* The drive is gone. */
void standing_suspend(struct standing *standing, const struct standing_rules *rules, db_time now);

/* A later motion ends the record; so does a later enable of a drive that was seen standing, which
 * would otherwise be disabled again. */
bool standing_gives_way_to(const struct standing *standing, enum db_command command);
/* The later motion or enable, for which `gives_way` was set when it began, has ended. It closes the
 * record if it was carried out, or may have been. */
void standing_motion_ended(struct standing *standing, bool may_go_on, db_time now);

/* A later enable was carried out: the drive must not be disabled again, but if it was not seen
 * standing it must still be stopped. */
void standing_drive_enabled(struct standing *standing);

/* Judges a sample whose request was sent at `asked`. */
enum standing_verdict standing_judge(struct standing *standing, const struct standing_rules *rules,
                                     const struct db_feedback *feedback, db_time asked,
                                     db_time now);
/* When a drive that can be reached counts as not stopping although no sample shows it;
 * DB_TIME_NEVER: this is known already, or does not apply. */
db_time standing_deadline(const struct standing *standing, const struct standing_rules *rules);
/* The drive does not stop; this holds until it is seen standing. `last_resort`: from now on it is
 * to be disabled. */
void standing_run_on(struct standing *standing, bool last_resort, db_time now);

#endif
