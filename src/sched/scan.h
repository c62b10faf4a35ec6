/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A scan as the bus carries it out: which address is asked next, and what comes of it. Internal to
 * src/sched. Made and freed by the network thread; from scan_begin() until it has ended the bus thread's,
 * but for what is said of each.
 */
#ifndef DRIVEBRIDGE_SCHED_SCAN_H
#define DRIVEBRIDGE_SCHED_SCAN_H

#include "drivebridge/scan.h"
#include "sched/state.h"

struct scan;

/* Network thread. Null when out of memory. The bus's configuration must outlive it. */
struct scan *scan_new(const struct db_bus_config *bus, const struct db_scan_plan *plan,
                      uint32_t number);
void scan_free(struct scan *scan);
uint32_t scan_number(const struct scan *scan);
/* Any thread. */
void scan_read(const struct scan *scan, struct db_scan_progress *progress);
bool scan_has_ended(const struct scan *scan);
void scan_cancel(struct scan *scan);
/* See drivebridge/scan.h. */
const struct db_scan_find *scan_find(const struct scan *scan, size_t index);
const struct db_scan_foreign *scan_foreign(const struct scan *scan, size_t index);

/* The rest is the bus thread's. */

/* The engine's from now on, until it has ended; the engine has none. */
void scan_begin(struct db_engine *engine, struct scan *scan, db_time now);
/* Ends the engine's, if it has one. The object is not touched any more. */
void scan_end(struct db_engine *engine, enum db_scan_end end);

bool scan_is_under_way(const struct db_engine *engine);

/* The bus's configuration with the speed that is asked at now; null: the bus is to be in service. The bus
 * opens its port with it, and again whenever another one is told. */
const struct db_bus_config *scan_port_config(const struct db_engine *engine);
/* That port is open, cannot be (a positive errno), or is lost. */
void scan_port(struct db_engine *engine, bool up, int error, db_time now);

/* Asks the next question, where one is due and there is time for it. True when it was sent. */
bool scan_send_next(struct db_engine *engine, db_time now);
/* When it is to be looked at again at the latest. */
db_time scan_wake(const struct db_engine *engine, db_time now);
/* The time of the question on the wire is up, if it is. */
void scan_look(struct db_engine *engine, db_time now);

/* A question to this node is on the wire. */
bool scan_holds_node(const struct db_engine *engine, const struct node *node);
/* Something is said to this node that does not wait: the question is given up, to be asked again. Behind a command
 * it is also asked again whether the drive stands. */
void scan_yield(struct db_engine *engine, const struct node *node, bool commands);

/* Bytes came; of them so many were no part of a frame. */
void scan_hear(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now);
void scan_note_garbage(struct db_engine *engine, size_t length);
/* A frame came. True when it was the scan's. */
bool scan_take_frame(struct db_engine *engine, enum db_frame kind, const uint8_t *frame,
                     size_t length, db_time now);
/* A frame that nobody here asked for (CAN). */
void scan_note_foreign(struct db_engine *engine, const uint8_t *bytes, size_t length);

#endif
