/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The requests of one drive that its bus has: how they get there, which of its stops stand for
 * others, and the writers that wait for their end. Network thread only.
 */
#ifndef DRIVEBRIDGE_AXIS_REQUESTS_H
#define DRIVEBRIDGE_AXIS_REQUESTS_H

#include "axis/pending.h"
#include "drivebridge/commander.h"

/* OK when the drive can be asked now. A stop is kept for a drive, or a bus, that may come back. */
enum db_result db_requests_reach(const struct db_commander *commander, enum db_command command);

/* Null: there is none of this ticket. */
struct db_slot *db_requests_find(const struct db_commander *commander, uint32_t ticket);

/* Hands a request to the bus, for a client or (null) for the bridge itself, and fills in its ticket
 * and drive. Null when the drive's or the bus's queue is full. */
struct db_slot *db_requests_submit(struct db_commander *commander, const struct db_client *client,
                                   struct db_request *request, uint16_t id);

/* A client's stop was submitted: who waits for an older one of its kind, or would be told of it,
 * waits for this one. */
void db_requests_take_over(struct db_commander *commander, struct db_slot *stop);

/*
 * The pending stop that one of this kind may join: the drive's newest command, or one that is then
 * handed to the bus once more. An older one must not be joined as it is, because what was queued
 * after it would run after both: where there is no place for another of its kind, it will be
 * repeated. Null: there is none.
 */
struct db_slot *db_requests_join_stop(struct db_commander *commander, enum db_command command);

/* A stop is to be handed to the bus as soon as one before it ended: nothing is to be sent before
 * that. */
bool db_requests_has_stop_to_repeat(const struct db_commander *commander);
/* A stop that came behind something else while there was no place for another of its kind is handed
 * to the bus now, where the place of the one before, `slot`, has just become free. */
void db_requests_repeat_stop(struct db_commander *commander, struct db_slot *slot, db_time now);
/* The same for those that found no room then. */
void db_requests_repeat_stops(struct db_commander *commander, db_time now);

/* The writer waits for the slot's end, unless it is not to wait or there is no room. */
struct db_write_answer db_requests_wait(struct db_commander *commander, struct db_slot *slot,
                                        struct db_write_token token, db_time now);
/* The request ended: its place is free, and who waits for it is answered. */
void db_requests_end(struct db_commander *commander, struct db_slot *slot, enum db_result result);
/* Answers everybody who waits; the requests stay pending. */
void db_requests_dismiss(struct db_commander *commander, enum db_result result);
/* Answers those whose time is up. */
void db_requests_expire(struct db_commander *commander, db_time now);

/* When db_requests_expire() or db_requests_repeat_stops() is due; DB_TIME_NEVER. */
db_time db_requests_deadline(const struct db_commander *commander);

#endif
