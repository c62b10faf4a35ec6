/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A scan as the bus carries it out: which address is asked next, and what is done with the answer.
 * Internal to src/bridge/sched. Made and freed by the network thread; owned by the bus thread from
 * scan_begin() until it has ended, unless a function says otherwise.
 */
#ifndef DRIVEBRIDGE_SCHED_SCAN_H
#define DRIVEBRIDGE_SCHED_SCAN_H

#include "drivebridge/scan.h"
#include "drivebridge/seqlock.h"
#include "sched/sched_private.h"
#include "sched/visit.h"

#include <stdatomic.h>

/* The question on the wire. */
struct question {
	bool flying;
	struct db_inquiry inquiry;
	struct visit_outcome outcome;
	size_t garbage;  /* bytes that were no frame, or a bad one */
	size_t received; /* bytes of any kind ... */
	size_t echoed;   /* ... of which this number, from the first on, echo the question */
	db_time sent;
	db_time silent_by; /* the question ends then if nothing was received */
	db_time deadline;
	db_time received_at;
};

struct scan {
	const struct db_bus_config *bus;
	struct db_scan_plan plan;
	uint32_t number;
	db_time latency; /* of the drives, as configured */

	/* Both threads. */
	atomic_bool cancelled; /* set by the network thread */
	atomic_bool ended;     /* set by the bus thread, which does not access it any more */
	/* how far it is, a struct db_scan_progress in `words` */
	atomic_uint sequence;
	db_seqlock_word words[DB_SEQLOCK_WORDS(struct db_scan_progress)];
	/* owned by the network thread as far as they are published */
	struct db_scan_find finds[DB_SCAN_FINDS_MAX];
	/* owned by the network thread after the end */
	struct db_scan_foreign foreign[DB_SCAN_FOREIGN_MAX];

	/* Bus thread only. */
	struct db_scan_progress progress;
	struct db_bus_config port; /* with the current speed, while the bus is out of service */
	bool port_up;
	size_t speed; /* index among the plan's speeds */
	bool visiting;
	struct visit visit;
	struct question question;
	struct db_exchange exchange;
	uint8_t request[DB_REQUEST_MAX];
	db_time cycle_used;    /* end of the cycle in which the last question was sent */
	db_time idle_since;    /* since when nothing was asked */
	db_time response_time; /* response time of the drive that is visited ... */
	bool response_known;   /* ... if it has answered yet */
	db_time not_before;    /* late answers from the address may arrive until then */
};

/* Network thread. Null when out of memory. The bus's configuration must outlive it. */
struct scan *scan_new(const struct db_bus_config *bus, const struct db_scan_plan *plan,
                      uint32_t number);
void scan_free(struct scan *scan);

/* All functions below: bus thread. */

/* The engine takes the scan until it has ended; the engine must not have one. */
void scan_begin(struct db_engine *engine, struct scan *scan, db_time now);
/* Ends the engine's scan, if it has one. The object is not accessed any more. */
void scan_end(struct db_engine *engine, enum db_scan_end end);

/* The bus's configuration with the speed that is scanned now; null: the bus is to be in service.
 * The bus opens its port with it, and again whenever another one is returned. */
const struct db_bus_config *scan_port_config(const struct db_engine *engine);
/* That port is open, cannot be opened (a positive errno), or is lost. */
void scan_port(struct db_engine *engine, bool up, int error, db_time now);

/* Sends the next question, if one is due and there is time for it. True if it was sent. */
bool scan_send_next(struct db_engine *engine, db_time now);
/* When the scan must be checked again at the latest. */
db_time scan_run_at(const struct db_engine *engine, db_time now);
/* Ends the question on the wire if its time is up. */
void scan_check(struct db_engine *engine, db_time now);

/* True if a question to this node is on the wire. */
bool scan_is_asking(const struct db_engine *engine, const struct node *node);
/* Something that does not wait is sent to this node: the question is abandoned and asked again
 * later. After a command the drive is also asked again whether it stands. */
void scan_give_way(struct db_engine *engine, const struct node *node, bool commands);

/* Bytes were received. */
void scan_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now);
/* A frame was received. True if it was the scan's. */
bool scan_receive_frame(struct db_engine *engine, enum db_frame kind, const uint8_t *frame,
                        size_t length, db_time now);
/* An unsolicited frame (CAN). */
void scan_count_foreign(struct db_engine *engine, const uint8_t *bytes, size_t length);

#endif
