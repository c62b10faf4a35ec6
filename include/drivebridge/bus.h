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
#include "drivebridge/transport.h"

struct db_bus;

struct db_bus_stats {
	bool up;             /* the port is open */
	uint32_t last_error; /* errno of the last failed open or lost port, 0 = none */
	uint32_t period_us;  /* configured cycle */
	uint32_t cycle_us;   /* time the last cycle's polling took */
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

/*
 * axes[i] belongs to the i-th of the bus's drives (in the configuration's order) and must outlive
 * the bus, as must the log (null: none). 0 or a negative errno.
 */
int db_bus_new(const struct db_config *config, size_t bus_index, struct db_axis *const *axes,
               struct db_log *log, struct db_bus **bus);

/* Starts and ends the thread. Ending first carries out each drive's on_exit, bounded in time. */
int db_bus_start(struct db_bus *bus);
void db_bus_stop(struct db_bus *bus);
/* Lets the ending begin without waiting for it, so that several buses can end side by side. */
void db_bus_ask_end(struct db_bus *bus);
void db_bus_free(struct db_bus *bus);

/* The following are for one other thread, the network's. */

/* False when the queue is full (stops never find it full). Copies the request. */
bool db_bus_submit(struct db_bus *bus, const struct db_request *request);

/* Becomes readable when completions wait; read by db_bus_completion() itself. */
int db_bus_completion_fd(const struct db_bus *bus);
bool db_bus_completion(struct db_bus *bus, struct db_completion *completion);

/* Grows with each turn of the bus's thread, at least twice a second. */
uint32_t db_bus_heartbeat(const struct db_bus *bus);

void db_bus_read_stats(const struct db_bus *bus, struct db_bus_stats *stats);

#endif
