/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The record of a drive that must stand: what it is told, why, since when, and what was seen of it since then.
 *
 * A stop enters it; a second one joins it, and the stronger kind wins. It is left when the drive was seen to stand
 * after the stop was sent, or when a later motion was carried out, and by nothing else: not by an answer, not by an
 * offline time, not by a port that was closed. Until then the stop is sent again, at a pace, unless the drive is seen
 * to slow down: an obedient drive is left alone, because no document says what a second stop does to a ramp.
 *
 * What counts is a sample whose question left after the stop did. It shows how fast the drive is, not how fast it
 * should slow down: deceleration may take seconds, by the drive's own ramps, and is no failure while it goes on. A
 * drive that can be reached and does not slow down for `patience` runs on, also when no sample tells anything.
 *
 * Pure: samples and the time are handed in. Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_STANDING_H
#define DRIVEBRIDGE_SCHED_STANDING_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"

#include <stdbool.h>

struct standing {
	enum db_command kind; /* the strongest stop that was asked for; NONE: the drive is free */
	unsigned kinds;       /* bit by command: all that were asked for */
	unsigned
		refused; /* likewise: those that the drive turned down since the last one that it took */
	unsigned causes;           /* bit by enum db_stand_cause */
	enum db_stand_cause cause; /* the one that joined last */
	db_time since;
	uint32_t count;    /* stops that were sent */
	db_time sent_at;   /* when the last one left; 0: none since a cause joined */
	db_time send_at;   /* when the next one may leave */
	unsigned losses;   /* in a row, of what was sent for it */
	db_time backoff;   /* how long an offline drive is left alone after the next loss */
	bool yields;       /* to a later motion that is under way */
	bool acknowledged; /* the drive answered the last stop itself: a slow-down is this stop's */
	bool confirmed;    /* a disable was answered: whether the power is off is known */

	bool may_move; /* it was not known to stand when the record was entered, or has moved since */
	bool obeys;    /* seen to slow down or to stand since the last cause joined */
	bool overdue;    /* it runs on */
	bool looked;     /* read since the stop was sent last */
	db_time look_at; /* when it is to be read, without waiting for the cycle */
	db_time look_by; /* until then a sample is waited for before the stop is sent again */
	db_time progress; /* when it was seen slower than ever before; 0: time has not begun to count */
	float top_speed; /* fastest since it was entered; drive units per second, without direction */
	float least_speed; /* slowest since it was fastest */
	db_time still_from; /* when it was first seen standing, in a row; 0: it moves, or was not seen */
	int32_t still_position; /* where that was */
};

/* Of the wire one part in this many goes to the stops of a drive that does not answer. */
#define STANDING_LOSSES_SHARE 5

enum standing_verdict {
	STANDING_UNSEEN,  /* nothing to be seen yet */
	STANDING_OBEYS,   /* it slows down, or stands and has to be seen once more */
	STANDING_DONE,    /* it stands: the record was left */
	STANDING_RUNS_ON, /* and it should not any more */
};

/* What is needed to judge a sample. */
struct standing_rules {
	db_time patience; /* how long a drive may take to slow down */
	db_time doubt; /* how long it must be seen to stand, where a motion may begin late; 0: it cannot */
};

static inline bool standing_is_free(const struct standing *standing)
{
	return standing->kind == DB_CMD_NONE;
}

/* Nothing was seen of the stop yet: commands wait for that, and so does the end. */
static inline bool standing_is_open(const struct standing *standing)
{
	return !standing_is_free(standing) && !standing->obeys;
}

/* It was read after the stop and stood; a position that goes on changing is no stand. */
static inline bool standing_is_seen(const struct standing *standing)
{
	return standing->obeys && standing->still_from != 0;
}

/* A cause joins. `known`: a fresh sample, or null when there is none. */
void standing_enter(struct standing *standing, enum db_command kind, enum db_stand_cause cause,
                    const struct db_feedback *known, db_time now);
/* The drive may do what it likes. */
void standing_leave(struct standing *standing);
/* A cause is withdrawn; without another one the record is left. */
void standing_withdraw(struct standing *standing, enum db_stand_cause cause);

/* When that is, if nothing else is in its way; DB_TIME_NEVER: an obedient drive is told no more. */
db_time standing_send_at(const struct standing *standing);
/* What the drive is told next: the strongest kind that it has not refused, or that kind again when it has refused
 * all of them. */
enum db_command standing_next(const struct standing *standing);

/* A stop has left. `trusted`: its answer will prove something; otherwise it is sent once more as soon as one would.
 * `round_trip`: how long the drive's latest exchange took. */
void standing_note_sent(struct standing *standing, bool trusted, db_time round_trip, db_time now);
/* The conversation of the stop has ended, and the drive has taken it or not. `acknowledged`: it said so itself. */
void standing_note_answered(struct standing *standing, enum db_command command, bool taken,
                            bool acknowledged, db_time now);
/* What was sent for it was not answered, which has cost so much of the wire. True when the next one must wait for its
 * share of the wire. `online`: others think that the drive is there. */
bool standing_note_loss(struct standing *standing, bool online, unsigned retries, db_time cost,
                        db_time now);

/* The drive, or its port, is there again: it is told first of all, and nothing that was seen before counts. */
void standing_resume(struct standing *standing, db_time now);
/* It is gone. */
void standing_suspend(struct standing *standing, const struct standing_rules *rules, db_time now);

/* A later motion ends the record; so does a later enable of a drive that was seen to stand: it would be disabled again. */
bool standing_gives_way_to(const struct standing *standing, enum db_command command);
/* Such a command that came after the stop begins. It ends the record if it was carried out, or may have been. */
void standing_yield(struct standing *standing);
void standing_note_motion(struct standing *standing, bool may_go_on, db_time now);

/* A later enable was carried out: the drive is not to be disabled again, but where it was not seen to stand it is to be
 * stopped on. */
void standing_note_enabled(struct standing *standing);

/* Looks at a sample whose question left at `asked`. */
enum standing_verdict standing_judge(struct standing *standing, const struct standing_rules *rules,
                                     const struct db_feedback *feedback, db_time asked,
                                     db_time now);
/* When a drive that can be reached runs on, though no sample says so; DB_TIME_NEVER: it is known to, or need not. */
db_time standing_deadline(const struct standing *standing, const struct standing_rules *rules);
/* It runs on, until it is seen to stand. `last_resort`: from now on it is to be disabled. */
void standing_run_on(struct standing *standing, bool last_resort, db_time now);

#endif
