/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Exchanges: one request on the wire and what comes back. Prepared by the driver in a lane of its drive, sent,
 * ended; and when the wire has room for one. Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_EXCHANGE_H
#define DRIVEBRIDGE_SCHED_EXCHANGE_H

#include "sched/state.h"

/* Several exchanges may be under way, one for each drive (CAN). */
bool exchange_overlaps(const struct db_engine *engine);
/* When something, or a stop, may be sent at the earliest; DB_TIME_NEVER: when something has happened. */
db_time exchange_may_begin_at(const struct db_engine *engine, bool stop, db_time now);
/* How long an exchange takes on the wire, without the drive's thinking. */
db_time exchange_wire_time(const struct db_engine *engine, const struct db_exchange *exchange);

/* Lets the driver begin a job; its first exchange is prepared when it says SEND. */
enum db_step exchange_begin_job(struct db_engine *engine, struct station *station,
                                enum lane_kind kind, enum db_job_kind job,
                                const struct db_request *request, db_time now,
                                enum db_result *result);
/* Puts a lane's prepared exchange on the wire. */
void exchange_send(struct db_engine *engine, struct station *station, enum lane_kind kind,
                   db_time now);
void exchange_send_probe(struct db_engine *engine, struct node *node, db_time now);
/* Likewise a lane's, or a probe before it where the node is out of step. */
void exchange_send_in_step(struct db_engine *engine, struct station *station, enum lane_kind kind,
                           db_time now);
/* The node's exchange is not under way any more. */
void exchange_end(struct db_engine *engine, struct node *node, db_time now);

/* A frame for all drives goes out: they are given time to act on it before they are asked something. */
void exchange_note_broadcast(struct db_engine *engine, const struct db_exchange *exchange,
                             db_time now);

#endif
