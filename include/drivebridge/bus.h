/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One bus: a thread that runs the cyclic schedule over one transport and its drives.
 */
#ifndef DRIVEBRIDGE_BUS_H
#define DRIVEBRIDGE_BUS_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"
#include "drivebridge/config.h"
#include "drivebridge/log.h"
#include "drivebridge/process.h"
#include "drivebridge/trace.h"
#include "drivebridge/transport.h"

struct db_bus;

/* A drive of a bus. Its configuration and axis must outlive its time on the bus. */
struct db_bus_drive {
	/* its number, which identifies it in requests; unique as long as it is there */
	uint16_t drive;
	const struct db_drive_config *config;
	struct db_axis *axis;
};

struct db_bus_stats {
	bool up;             /* the port is open */
	bool aside;          /* it is not up because a scan has the bus alone */
	uint32_t last_error; /* errno of the last failed open or lost port, 0 = none */
			     /* the process that has the port, while it is busy; "": not known */
	char holder[DB_PROCESS_WORDS_MAX];
	/* when it was lost, or first missing; for a bus that is up the last time */
	db_time down_since;
	uint32_t period_us; /* configured cycle */
	uint32_t cycle_us;  /* time the last cycle's polling took */
	uint32_t cycle_max_us;
	uint32_t jitter_us; /* lateness of the last cycle's start */
	uint32_t jitter_max_us;
	/* permille of the last second in which the wire was busy or an answer awaited */
	uint32_t utilisation;
	uint32_t cycles;
	/* cycles in which not all drives were read, or not all moving ones where a cycle has room
	 * for no more */
	uint32_t overruns;
	uint32_t transactions;
	uint32_t retries;
	uint32_t timeouts;
	uint32_t bad_frames;   /* frames with a wrong checksum or form */
	uint32_t stray_frames; /* good frames that nobody asked for */
	uint32_t garbage_bytes;
	uint32_t reports; /* frames that drives sent unasked and that were used */
	uint32_t opens;   /* number of times the port was opened */
	uint32_t queued;  /* commands waiting now */
	uint32_t online;  /* drives online now */
	/* total delay of its thread after the times it asked for: the computer is busy */
	uint64_t overslept_us;
	struct db_port_health port;
};

/* The configuration and the log (null: none) must outlive the bus. 0 or a negative errno. */
int db_bus_new(const struct db_bus_config *config, const struct db_bus_drive *drives,
               size_t drive_count, struct db_log *log, struct db_bus **bus);

/* Starts and ends the thread. The end first carries out each drive's on_exit, within a time
 * limit. */
int db_bus_start(struct db_bus *bus);
void db_bus_stop(struct db_bus *bus);
/* Starts the end without waiting for it, so that several buses can end in parallel. */
void db_bus_ask_end(struct db_bus *bus);
/* True if it has ended, so that db_bus_stop() and db_bus_free() do not wait. Signalled by the
 * descriptor of the completions. */
bool db_bus_has_ended(const struct db_bus *bus);
void db_bus_free(struct db_bus *bus);

/* The following are for one other thread, the network thread. */

/* Copies the request and returns the copy, which stays where it is until it is released; null when
 * the queue is full (stops never find it full). */
struct db_request *db_bus_submit(struct db_bus *bus, const struct db_request *request);

/* The bus takes the requests submitted from true to false together: a stop for all its drives is
 * then one frame where the family has one, whatever the timing of the two threads. Not nested. */
void db_bus_gather(struct db_bus *bus, bool gathers);

/* Becomes readable when completions wait; read by db_bus_completion() itself. */
int db_bus_completion_fd(const struct db_bus *bus);
/* A request that has ended, once; null when there is none. To be released when its result was
 * recorded. */
struct db_request *db_bus_completion(struct db_bus *bus);
void db_bus_release(struct db_request *request);

/*
 * Drives that are removed from a running bus and drives that are added to it, while its other
 * drives are not affected. A removed drive first carries out its on_exit, within a time limit;
 * requests for it that have not ended by then end as cancelled. When the last one is removed, the
 * new ones are added: an address may be used again.
 *
 * Everything is allocated by db_bus_change_new() and freed by db_bus_change_free(): after it was
 * carried out, or instead of db_bus_change(). One change at a time.
 */
struct db_change;

int db_bus_change_new(struct db_bus *bus, const uint16_t *leaving, size_t leaving_count,
                      const struct db_bus_drive *coming, size_t coming_count,
                      struct db_change **change);
/* Hands over the change, which the bus then owns. No requests but stops may be submitted for drives
 * that are being removed. */
void db_bus_change(struct db_bus *bus, struct db_change *change);
/* The change, once, after it was carried out; else null. Signalled by the descriptor of the
 * completions. By then every request for the removed drives has its completion, which must be
 * fetched after this call. */
struct db_change *db_bus_take_changed(struct db_bus *bus);
void db_bus_change_free(struct db_change *change);

/* Incremented with each turn of the bus's thread, at least twice a second. */
uint32_t db_bus_heartbeat(const struct db_bus *bus);

/* The trace of its frames, for readers. Lives as long as the bus. New trouble in it is signalled by
 * the descriptor of the completions. */
const struct db_trace *db_bus_trace(const struct db_bus *bus);

void db_bus_read_stats(const struct db_bus *bus, struct db_bus_stats *stats);

#endif
