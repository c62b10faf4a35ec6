/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is wrong with a drive or a bus, in one word, and what somebody has to do about it. This is the only place that
 * decides it: front ends show what comes from here, and hold no second opinion. Pure; any thread.
 */
#ifndef DRIVEBRIDGE_TROUBLE_H
#define DRIVEBRIDGE_TROUBLE_H

#include "drivebridge/axis.h"

/* Codes of the register `trouble`: appended, never renumbered. */
enum db_trouble_cause {
	DB_TROUBLE_NONE = 0,
	DB_TROUBLE_PORT = 1,                /* the port or interface of its bus is not open */
	DB_TROUBLE_ASIDE = 2,               /* its bus is set aside for a scan */
	DB_TROUBLE_NO_ANSWER = 3,           /* nothing comes from it */
	DB_TROUBLE_NOT_UNDERSTOOD = 4,      /* what comes from it is no answer */
	DB_TROUBLE_LATE = 5,                /* its answers come after drive-latency-ms */
	DB_TROUBLE_DEAF = 6,                /* it does not hear what follows its answers at once */
	DB_TROUBLE_TWO_DRIVES = 7,          /* two drives answer at its address */
	DB_TROUBLE_RUNS_ON = 8,             /* it was told to stop, and does not slow down */
	DB_TROUBLE_MUST_STAND = 9,          /* it was told to stop, and is not seen to stand */
	DB_TROUBLE_FAULT = 10,              /* the drive reports one: see `error` */
	DB_TROUBLE_WATCHDOG = 11,           /* the watchdog has stopped it */
	DB_TROUBLE_WARNING = 12,            /* the drive warns */
	DB_TROUBLE_MAY_HAVE_RESTARTED = 13, /* one sign of a restart came, see enum db_doubt */
	DB_TROUBLE_ORIGIN_LOST = 14,
	DB_TROUBLE_PARAMS_UNSAVED = 15,
	DB_TROUBLE_COUNT
};

/* What somebody has to do, in this order. */
enum db_trouble_need {
	DB_NEED_NOTHING,
	DB_NEED_HINT, /* all is well, and something is good to know */
	DB_NEED_LOOK,
	DB_NEED_ACT,
};

/* What is known beside the feedback. */
struct db_trouble_signs {
	/* Why it does not answer: NO_ANSWER, NOT_UNDERSTOOD, LATE or DEAF. */
	enum db_trouble_cause silence;
	bool aside;       /* its bus is set aside for a scan */
	bool two_drives;  /* a second one answered lately */
	bool stands_late; /* see db_trouble_stands_late() */
	bool latched;     /* the watchdog stopped it */
};

/* The worst of what is wrong. */
enum db_trouble_cause db_trouble_of(const struct db_feedback *feedback,
                                    const struct db_trouble_signs *signs);
/* It has had to stand for longer than a stop of every day takes. */
bool db_trouble_stands_late(const struct db_must_stand *must_stand, db_time now);

const char *db_trouble_name(unsigned cause); /* "none", "port" ...; "unknown" */
enum db_trouble_need db_trouble_need(enum db_trouble_cause cause);
const char *db_trouble_need_name(enum db_trouble_need need); /* nothing hint look act */

/* Whom advice is for. Texts may be null where they do not matter. */
struct db_trouble_about {
	const char *drive;
	const char *bus;
	const char *place; /* the port or interface of the bus */
	unsigned address;
	uint16_t error;          /* of a FAULT: enum db_error */
	const char *port_advice; /* of a PORT: see db_trouble_port_advice() */
	unsigned late_ms;        /* of LATE: how late it was last; 0: not known */
};

#define DB_TROUBLE_ADVICE_MAX 320

/* What to do about it, as a sentence without its full stop; "" where nothing is to be done. */
void db_trouble_advice(enum db_trouble_cause cause, const struct db_trouble_about *about,
                       char text[DB_TROUBLE_ADVICE_MAX]);
/* What to check of a drive that reports this error. */
const char *db_trouble_fault_advice(uint16_t error);
/* What to check of a port that could not be opened, or was lost, with this errno; "" where that is not known. */
const char *db_trouble_port_advice(bool serial, int error);

#endif
