/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Looking for drives on a bus, at addresses that no configuration names, and setting one up: its
 * address or the speed of its bus. With the bus in service this is done after everything else, in
 * the time that cycles leave. With the bus set aside its drives are left in the state of their
 * on_exit and are offline until it is back in service.
 *
 * Network thread. The bus writes its finds into the scan's own memory: it allocates nothing.
 */
#ifndef DRIVEBRIDGE_SCAN_H
#define DRIVEBRIDGE_SCAN_H

#include "drivebridge/bus.h"
#include "drivebridge/driver.h"

#define DB_SCAN_SPEEDS_MAX 24
#define DB_SCAN_FINDS_MAX 256
#define DB_SCAN_FOREIGN_MAX 64
#define DB_SCAN_WHOSE_MAX 272

/* What to look for. */
struct db_scan_plan {
	unsigned first; /* addresses, both included */
	unsigned last;
	bool aside; /* the bus is set aside; else it stays in service at its own speed */
	size_t speed_count;
	unsigned speeds[DB_SCAN_SPEEDS_MAX]; /* bit/s; with `aside` only */
	/* Instead of looking: what is set in the drive at `first`, if it stands. THERE: nothing. */
	enum db_inquiry_kind set_up;
	unsigned value;
	char whose[DB_SCAN_WHOSE_MAX]; /* the client that wants it, for messages; "": not known */
};

/* How an address answered. */
enum db_scan_verdict {
	DB_SCAN_ONE, /* as one drive answers */
	DB_SCAN_TWO, /* two drives have it */
		     /* something is received, but no answer: two drives at once, or disturbance */
	DB_SCAN_GARBLED,
};

/* An address from which something was received. Times from the question to the whole answer, in
 * microseconds. */
struct db_scan_find {
	unsigned speed; /* bit/s */
	unsigned address;
	enum db_scan_verdict verdict;
	char identity[DB_IDENTITY_MAX + 1]; /* "": not reported */
	char other[DB_IDENTITY_MAX + 1];    /* of a second drive, if it could be read */
	uint32_t asked;
	uint32_t answered; /* times with one good answer, or with two */
	uint32_t garbled;  /* times with bytes that were no answer, or more than one */
	uint32_t doubled;  /* times with two good answers */
	uint32_t time_min_us;
	uint32_t time_mean_us;
	uint32_t time_max_us;
};

/* Unsolicited frames on a CAN bus. */
struct db_scan_foreign {
	uint32_t id; /* with the flags of codec/can.h */
	uint32_t count;
};

enum db_scan_end {
	DB_SCAN_RUNS,
	DB_SCAN_DONE,
	DB_SCAN_CANCELLED, /* by its client, or because the bus ends */
	DB_SCAN_NO_ROOM,   /* its cycles leave no time for a question: needed_us, gap_us */
	/* `drive` does not stand, or is not known to: the bus was not set aside, or nothing was
	 * saved */
	DB_SCAN_MOVES,
	DB_SCAN_PORT,       /* the port cannot be opened: error */
	DB_SCAN_REFUSED,    /* set_up: the drive refused it */
	DB_SCAN_SILENT,     /* set_up: it did not answer: it is not known whether it was set */
	DB_SCAN_NOT_ONE,    /* set_up: not one drive answers there; nothing was changed */
	DB_SCAN_STANDS_NOT, /* set_up: it moves; nothing was changed */
};

struct db_scan_progress {
	enum db_scan_end end;
	uint32_t asked; /* addresses done, at all speeds */
	uint32_t total;
	unsigned speed; /* the current speed */
	unsigned address;
	uint32_t finds;
	uint32_t wait_us;   /* how long a drive may take to answer and still be found */
	uint32_t needed_us; /* a question takes up to this long ... */
	uint32_t gap_us;    /* ... and this is left of a cycle */
	int error;          /* errno */
	uint16_t drive;     /* see struct db_bus_drive */
	uint32_t foreign;   /* number of ids; the first of them are kept */
};

/*
 * Begins a scan. 0; -EBUSY: another one is in progress; -EINVAL: the plan has an address or a speed
 * that drives of this bus cannot have; -ENOMEM. *number identifies it.
 */
int db_bus_scan(struct db_bus *bus, const struct db_scan_plan *plan, uint32_t *number);

/* False when there is no such scan (any more). */
bool db_bus_scan_read(const struct db_bus *bus, uint32_t number, struct db_scan_progress *progress);
/* Of finds[0 .. progress.finds); and, when it has ended, of foreign[0 .. the lesser of its number
 * and DB_SCAN_FOREIGN_MAX). */
const struct db_scan_find *db_bus_scan_find(const struct db_bus *bus, size_t index);
const struct db_scan_foreign *db_bus_scan_foreign(const struct db_bus *bus, size_t index);

/* Ends it as soon as the exchange on the wire has ended; a bus that was set aside returns to
 * service. */
void db_bus_scan_cancel(struct db_bus *bus, uint32_t number);

#endif
