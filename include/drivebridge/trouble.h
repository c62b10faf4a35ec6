/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is wrong with a drive or a bus, in one word, and what has to be done about it. This is
 * decided only here: front ends show this result and do not judge themselves. Pure; any thread.
 */
#ifndef DRIVEBRIDGE_TROUBLE_H
#define DRIVEBRIDGE_TROUBLE_H

#include "drivebridge/axis.h"

/* Codes of the register `trouble`: appended, never renumbered. */
enum db_trouble_cause {
	DB_TROUBLE_NONE = 0,
	DB_TROUBLE_PORT = 1,           /* the port or interface of its bus is not open */
	DB_TROUBLE_ASIDE = 2,          /* its bus is set aside for a scan */
	DB_TROUBLE_NO_ANSWER = 3,      /* nothing is received from it */
	DB_TROUBLE_NOT_UNDERSTOOD = 4, /* what is received from it is no answer */
	DB_TROUBLE_LATE = 5,           /* its answers arrive after drive-latency-ms */
				       /* it does not receive requests right after its answers */
	DB_TROUBLE_DEAF = 6,
	DB_TROUBLE_TWO_DRIVES = 7,          /* two drives answer at its address */
	DB_TROUBLE_RUNS_ON = 8,             /* it was told to stop, and does not slow down */
	DB_TROUBLE_MUST_STAND = 9,          /* it was told to stop, and is not seen standing */
	DB_TROUBLE_FAULT = 10,              /* the drive reports a fault: see `error` */
	DB_TROUBLE_WATCHDOG = 11,           /* the watchdog has stopped it */
	DB_TROUBLE_WARNING = 12,            /* the drive reports a warning */
	DB_TROUBLE_MAY_HAVE_RESTARTED = 13, /* one sign of a restart was seen, see enum db_doubt */
	DB_TROUBLE_ORIGIN_LOST = 14,
	DB_TROUBLE_PARAMS_UNSAVED = 15,
	DB_TROUBLE_COUNT
};

/* What a person has to do, in this order. */
enum db_trouble_need {
	DB_NEED_NOTHING,
	DB_NEED_HINT, /* all is well, but there is something to know */
	DB_NEED_LOOK,
	DB_NEED_ACT,
};

/* What is known in addition to the feedback. */
struct db_trouble_signs {
	/* Why it does not answer: NO_ANSWER, NOT_UNDERSTOOD, LATE or DEAF. */
	enum db_trouble_cause silence;
	bool aside;       /* its bus is set aside for a scan */
	bool two_drives;  /* a second one answered recently */
	bool stands_late; /* see db_trouble_stands_late() */
	bool latched;     /* the watchdog stopped it */
};

/* The most serious trouble. */
enum db_trouble_cause db_trouble_of(const struct db_feedback *feedback,
                                    const struct db_trouble_signs *signs);
/* True if it has had to stand for longer than an ordinary stop takes. */
bool db_trouble_stands_late(const struct db_must_stand *must_stand, db_time now);

/* `up`: its port is open and carries something; `aside`: a scan has it. */
static inline enum db_trouble_cause db_trouble_of_bus(bool up, bool aside)
{
	return up ? DB_TROUBLE_NONE : aside ? DB_TROUBLE_ASIDE : DB_TROUBLE_PORT;
}

const char *db_trouble_name(unsigned cause); /* "none", "port" ...; "unknown" */
enum db_trouble_need db_trouble_need(enum db_trouble_cause cause);
const char *db_trouble_need_name(enum db_trouble_need need); /* nothing hint look act */

/* The subject of advice. Texts may be null where they do not matter. */
struct db_trouble_about {
	const char *drive;
	const char *bus;
	unsigned address;
	const struct db_driver *driver; /* for FAULT: of its family */
	uint16_t error;                 /* for FAULT: enum db_error */
	const char *port_advice;        /* for PORT: see db_trouble_port_advice() */
	unsigned late_ms;               /* for LATE: how late it was last; 0: not known */
	const char *scan; /* for ASIDE: the client whose scan has the bus; "": not known */
};

#define DB_TROUBLE_ADVICE_MAX 320

/* What to do about it, as a sentence without its full stop; "" where there is nothing to do. */
void db_trouble_advice(enum db_trouble_cause cause, const struct db_trouble_about *about,
                       char text[DB_TROUBLE_ADVICE_MAX]);
/* What to check on a drive of this family that reports this error. */
const char *db_trouble_fault_advice(const struct db_driver *driver, uint16_t error);
/* What to check on a port that could not be opened, or was lost, with this errno; "" where that is
 * not known. `device` is its name, `holder` the process that has it while it is busy ("": not
 * known); both may be null. */
void db_trouble_port_advice(bool serial, int error, const char *device, const char *holder,
                            char text[DB_TROUBLE_ADVICE_MAX]);

#endif
