/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Looking for drives on a bus, at addresses that no configuration names, and setting one up: its address
 * or the speed of its bus. With the bus in service this goes on behind everything else, in the time that
 * cycles leave. With the bus set aside its drives are left as their on_exit says and are offline until it
 * is back in service.
 *
 * Network thread. What the bus finds it writes into the scan's own memory: it allocates nothing.
 */
#ifndef DRIVEBRIDGE_SCAN_H
#define DRIVEBRIDGE_SCAN_H

#include "drivebridge/bus.h"
#include "drivebridge/driver.h"

#define DB_SCAN_SPEEDS_MAX 24
#define DB_SCAN_FINDS_MAX 256
#define DB_SCAN_FOREIGN_MAX 64

/* What is to be looked for. */
struct db_scan_plan {
	unsigned first; /* addresses, both included */
	unsigned last;
	bool aside; /* the bus is set aside; else it stays in service at its own speed */
	size_t speed_count;
	unsigned speeds[DB_SCAN_SPEEDS_MAX]; /* bit/s; with `aside` only */
	/* Instead of looking: the drive at `first` is told this, where it stands. THERE: nothing is. */
	enum db_inquiry_kind set_up;
	unsigned value;
};

/* How an address answered. */
enum db_scan_verdict {
	DB_SCAN_ONE,     /* as one drive does */
	DB_SCAN_TWO,     /* two drives have it */
	DB_SCAN_GARBLED, /* something comes, but no answer: two drives at once, or disturbance */
};

/* An address from which something came. Times from the question to the whole answer, in microseconds. */
struct db_scan_find {
	unsigned speed; /* bit/s */
	unsigned address;
	enum db_scan_verdict verdict;
	char identity[DB_IDENTITY_MAX + 1]; /* "": not told */
	char other[DB_IDENTITY_MAX + 1];    /* of a second drive, where that could be read */
	uint32_t asked;
	uint32_t answered; /* with one good answer, or with two */
	uint32_t garbled;  /* with bytes that were none, or more than an answer */
	uint32_t doubled;  /* with two good answers */
	uint32_t time_min_us;
	uint32_t time_mean_us;
	uint32_t time_max_us;
};

/* Frames of a CAN bus that nobody here asked for. */
struct db_scan_foreign {
	uint32_t id; /* with the flags of codec/can.h */
	uint32_t count;
};

enum db_scan_end {
	DB_SCAN_RUNS,
	DB_SCAN_DONE,
	DB_SCAN_CANCELLED, /* by its client, or because the bus ends */
	DB_SCAN_NO_ROOM,   /* its cycles leave no time for a question: needed_us, gap_us */
	DB_SCAN_MOVES, /* `drive` does not stand, or is not known to: the bus was not set aside, nothing saved */
	DB_SCAN_PORT,       /* the port cannot be opened: error */
	DB_SCAN_REFUSED,    /* set_up: the drive said no */
	DB_SCAN_SILENT,     /* set_up: it did not answer: whether it did it is not known */
	DB_SCAN_NOT_ONE,    /* set_up: not one drive answers there; nothing was changed */
	DB_SCAN_STANDS_NOT, /* set_up: it moves; nothing was changed */
};

struct db_scan_progress {
	enum db_scan_end end;
	uint32_t asked; /* addresses that are done, at all speeds */
	uint32_t total;
	unsigned speed; /* where it is now */
	unsigned address;
	uint32_t finds;
	uint32_t wait_us;   /* how long a drive may think before it answers, to be found */
	uint32_t needed_us; /* a question takes up to so long ... */
	uint32_t gap_us;    /* ... and so much is left of a cycle */
	int error;          /* errno */
	uint16_t drive;     /* see struct db_bus_drive */
	uint32_t foreign;   /* ids; the first of them are kept */
};

/*
 * Begins one. 0; -EBUSY: another one is under way; -EINVAL: the plan has an address or a speed that drives
 * of this bus cannot have; -ENOMEM. *number names it.
 */
int db_bus_scan(struct db_bus *bus, const struct db_scan_plan *plan, uint32_t *number);

/* False when there is no such scan (any more). */
bool db_bus_scan_read(const struct db_bus *bus, uint32_t number, struct db_scan_progress *progress);
/* Of finds[0 .. progress.finds); and, when it has ended, of foreign[0 .. the lesser of its number and
 * DB_SCAN_FOREIGN_MAX). */
const struct db_scan_find *db_bus_scan_find(const struct db_bus *bus, size_t index);
const struct db_scan_foreign *db_bus_scan_foreign(const struct db_bus *bus, size_t index);

/* Ends it as soon as what is on the wire has ended; a bus that was set aside returns to service. */
void db_bus_scan_cancel(struct db_bus *bus, uint32_t number);

#endif
