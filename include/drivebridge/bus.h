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
#include "drivebridge/trace.h"
#include "drivebridge/transport.h"

struct db_bus;

/* A drive as its bus knows it. Its configuration and axis must outlive its time on the bus. */
struct db_bus_drive {
	uint16_t
		drive; /* its number: names it in requests; no other one's as long as it is there */
	const struct db_drive_config *config;
	struct db_axis *axis;
};

struct db_bus_stats {
	bool up;             /* the port is open */
	bool aside;          /* it is not up because a scan has the bus alone */
	uint32_t last_error; /* errno of the last failed open or lost port, 0 = none */
	db_time down_since; /* when it went, or was first missed; of a bus that is up the last time */
	uint32_t period_us; /* configured cycle */
	uint32_t cycle_us;  /* time the last cycle's polling took */
	uint32_t cycle_max_us;
	uint32_t jitter_us; /* lateness of the last cycle's start */
	uint32_t jitter_max_us;
	uint32_t utilisation; /* permille of the last second that the wire was busy or waited for */
	uint32_t cycles;
	uint32_t overruns; /* cycles whose polling had not ended when the next was due */
	uint32_t transactions;
	uint32_t retries;
	uint32_t timeouts;
	uint32_t bad_frames;   /* frames with a wrong checksum or form */
	uint32_t stray_frames; /* good frames nobody asked for */
	uint32_t garbage_bytes;
	uint32_t reports; /* frames that drives sent unasked and that were used */
	uint32_t opens;   /* how often the port was opened */
	uint32_t queued;  /* commands waiting now */
	uint32_t online;  /* drives online now */
	struct db_port_health port;
};

/* The configuration and the log (null: none) must outlive the bus. 0 or a negative errno. */
int db_bus_new(const struct db_bus_config *config, const struct db_bus_drive *drives,
               size_t drive_count, struct db_log *log, struct db_bus **bus);

/* Starts and ends the thread. Ending first carries out each drive's on_exit, bounded in time. */
int db_bus_start(struct db_bus *bus);
void db_bus_stop(struct db_bus *bus);
/* Lets the ending begin without waiting for it, so that several buses can end side by side. */
void db_bus_ask_end(struct db_bus *bus);
/* Whether it has ended, so that db_bus_stop() and db_bus_free() do not wait. Told by the descriptor
 * of the completions. */
bool db_bus_has_ended(const struct db_bus *bus);
void db_bus_free(struct db_bus *bus);

/* The following are for one other thread, the network's. */

/* False when the queue is full (stops never find it full). Copies the request. */
bool db_bus_submit(struct db_bus *bus, const struct db_request *request);

/* What is submitted from true to false the bus takes all at once: a stop for all its drives then is
 * one frame where the family has one, however the two threads run. Not nested. */
void db_bus_gather(struct db_bus *bus, bool gathers);

/* Becomes readable when completions wait; read by db_bus_completion() itself. */
int db_bus_completion_fd(const struct db_bus *bus);
bool db_bus_completion(struct db_bus *bus, struct db_completion *completion);

/*
 * Drives that leave a running bus and drives that come to it, while its other drives go on as ever.
 * Who leaves does what its on_exit says, bounded in time; requests for it that have not ended by then
 * end as cancelled. When the last one has left, the others come: an address may be used again.
 *
 * Everything is allocated by db_bus_change_new() and freed by db_bus_change_free(): when it was
 * carried out, or instead of db_bus_change(). One change at a time.
 */
struct db_change;

int db_bus_change_new(struct db_bus *bus, const uint16_t *leaving, size_t leaving_count,
                      const struct db_bus_drive *coming, size_t coming_count,
                      struct db_change **change);
/* Hands it over; then it is the bus's. No requests but stops are to be submitted for drives that leave. */
void db_bus_change(struct db_bus *bus, struct db_change *change);
/* The change, once, when it was carried out; else null. Told by the descriptor of the completions. By
 * then every request for the drives that left has its completion, which is to be fetched after this
 * call. */
struct db_change *db_bus_take_changed(struct db_bus *bus);
void db_bus_change_free(struct db_change *change);

/* Grows with each turn of the bus's thread, at least twice a second. */
uint32_t db_bus_heartbeat(const struct db_bus *bus);

/* What it carried last, for readers. Lives as long as the bus. Trouble in it is told by the descriptor of the
 * completions. */
const struct db_trace *db_bus_trace(const struct db_bus *bus);

void db_bus_read_stats(const struct db_bus *bus, struct db_bus_stats *stats);

#endif
