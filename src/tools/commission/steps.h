/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tries the first drive of a kind step by step: decides the next action, and judges its outcome. It
 * requests actions and receives their outcomes; a terminal, a script or a page carries them out.
 *
 * Pure but for its memory.
 */
#ifndef DRIVEBRIDGE_COMMISSION_STEPS_H
#define DRIVEBRIDGE_COMMISSION_STEPS_H

#include "commission/trial.h"

#include <jansson.h>
#include <stdbool.h>

#define DB_COMMISSION_TEXT 512

/* A motion that nobody holds any more may continue for this time; then it is stopped. */
#define DB_COMMISSION_SILENT_MS 1500

/* Most repetitions of a motion whose times are doubtful. */
#define DB_COMMISSION_REPEATS_MAX 2

/* Verdicts of a setting. */
#define DB_COMMISSION_PROVEN "proven"
#define DB_COMMISSION_CONTRADICTED "contradicted"
#define DB_COMMISSION_NOT_SEEN "not seen"
#define DB_COMMISSION_NOT_FOR "does not apply"

enum db_commission_kind {
	DB_COMMISSION_ASK,   /* the user, `text`; one of `choices` */
	DB_COMMISSION_READ,  /* process data, counters, troubles */
	DB_COMMISSION_RUN,   /* a command without motion */
	DB_COMMISSION_MOVE,  /* at `velocity` for `ms`, held; ended by `ending` */
	DB_COMMISSION_WATCH, /* samples, for `ms` at most, until `until` */
};

enum db_commission_until { DB_COMMISSION_TIME, DB_COMMISSION_OFFLINE, DB_COMMISSION_ONLINE };

struct db_commission_action {
	enum db_commission_kind kind;
	const char *id;      /* of a question: STEP.WHAT, never changed, for scripts */
	const char *choices; /* with spaces between; "": a number above 0 */
	char text[DB_COMMISSION_TEXT];
	const char *command; /* RUN */
	const char *ending;  /* MOVE: stop, quick_stop, or silence: no more keep-alives */
	double velocity;     /* MOVE: as target_velocity */
	bool unheld; /* MOVE: only the watchdog of silent clients ends it, no dead man's rule */
	/* MOVE, WATCH: its figures are times, so it is repeated when they are doubtful */
	bool timed;
	bool again; /* it is a repetition */
	unsigned ms;
	enum db_commission_until until;
};

struct db_commission_outcome {
	const char *answer; /* ASK; NULL: the user does not know, or the question is skipped */
	const char
		*result; /* RUN, MOVE: as the register `result` names it, or the error's own word */
	double took_ms;  /* RUN */
	const struct db_trial *trial; /* MOVE, WATCH */
	/* READ: an object with the values, those of status bits as true or false (`online` ...),
	 * `trouble` and `advice`, and whether the service has found its answers `late`, or the
	 * drive `deaf` after them. WATCH with `until`: whether that occurred, as `seen`. */
	const json_t *values;
};

/* What is known in advance. All of it stays the caller's. */
struct db_commission_facts {
	const char *family;
	const char *unit_name;
	json_t *drive_keys; /* of the drive's section today: names to texts */
	json_t *bus_keys;
	double velocity;     /* of trial motions, as target_velocity */
	double max_velocity; /* also as target_velocity; 0: no limit */
	unsigned ms;         /* duration of one */
	unsigned cycle_ms;
};

struct db_commission {
	struct db_commission_facts facts;
	/* one object per setting: step, setting, section, verdict, now, right, how */
	json_t *verdicts;
	const char *step_name; /* of the current step */
	size_t step;           /* index in db_commission_list */
	unsigned stage;        /* of that step */
	bool may_move;         /* the user confirmed that it is uncoupled */
	bool enabled;          /* the motor had power, before a motion */
	double direction;      /* of the last motion: 1 or -1 */
	bool absent;           /* the drive does not answer: nothing else can be tried */
	/* A value that a step keeps from one of its stages to the next. */
	double remembered;
	struct db_commission_action latest; /* of this step */
	unsigned repeats;                   /* of the latest action */
	/* nothing was received for this time while the latest times were measured; 0: no gap */
	double doubt_ms;
	struct db_trial_figures figures;
	json_t *before;
};

struct db_commission_step {
	const char *name;
	bool moves;  /* has motions */
	bool chosen; /* runs only when it is named */
	const char *description;
};

/* In their order; the last one has no name. */
extern const struct db_commission_step db_commission_list[];

/* The index of a step, or -1. */
int db_commission_find(const char *name);

void db_commission_open(struct db_commission *commission, const struct db_commission_facts *facts);
void db_commission_close(struct db_commission *commission);

/* Begins a step. Its verdicts of an earlier round are removed. */
void db_commission_begin(struct db_commission *commission, size_t step);

/*
 * The next action of this step, after the outcome of the action before (NULL for the first one).
 * False: the step has ended, and its verdicts are complete.
 */
bool db_commission_next(struct db_commission *commission,
                        const struct db_commission_outcome *outcome,
                        struct db_commission_action *action);

/* Settings without a verdict become "not seen", those that the family does not have "does not
 * apply". */
void db_commission_fill(struct db_commission *commission);

#endif
