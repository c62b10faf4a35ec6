/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A scan as the bus carries it out: which address is asked next, and what is done with the answer.
 * Internal to src/bridge/sched. Made and freed by the network thread; owned by the bus thread from
 * scan_begin() until it has ended, unless a function says otherwise.
 */
#ifndef DRIVEBRIDGE_SCHED_SCAN_H
#define DRIVEBRIDGE_SCHED_SCAN_H

#include "drivebridge/scan.h"
#include "sched/sched_private.h"

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

/* All functions below: bus thread. */

/* The engine takes the scan until it has ended; the engine must not have one. */
void scan_begin(struct db_engine *engine, struct scan *scan, db_time now);
/* Ends the engine's scan, if it has one. The object is not accessed any more. */
void scan_end(struct db_engine *engine, enum db_scan_end end);

bool scan_is_under_way(const struct db_engine *engine);

/* The bus's configuration with the speed that is scanned now; null: the bus is to be in service.
 * The bus opens its port with it, and again whenever another one is returned. */
const struct db_bus_config *scan_port_config(const struct db_engine *engine);
/* The client that wants the current scan; "": unknown, or there is no scan. */
const char *scan_client(const struct db_engine *engine);
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

/* The question that is on the wire; null: none is. */
const struct db_exchange *scan_question(const struct db_engine *engine);

/* Bytes were received; `garbage` of them were not part of a frame. */
void scan_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now);
void scan_count_garbage(struct db_engine *engine, size_t length);
/* A frame was received. True if it was the scan's. */
bool scan_receive_frame(struct db_engine *engine, enum db_frame kind, const uint8_t *frame,
                        size_t length, db_time now);
/* An unsolicited frame (CAN). */
void scan_count_foreign(struct db_engine *engine, const uint8_t *bytes, size_t length);

#endif
