/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The only path of commands between the network thread and one bus thread: a fixed set of places
 * for requests, each owned by one side at a time. The network thread copies a request into a free
 * place; the bus thread works on it there and finishes it; the network thread collects it with its
 * result, and releases the place when that is recorded. The bus allocates nothing, and nothing can
 * overflow: a request keeps its place to its end.
 */
#ifndef DRIVEBRIDGE_SCHED_QUEUE_H
#define DRIVEBRIDGE_SCHED_QUEUE_H

#include "drivebridge/command.h"
#include "drivebridge/driver.h"

#include <stdbool.h>
#include <stddef.h>

struct db_queue;

/*
 * Places for stops reserved for each drive, which no other drive can take: two for each stop
 * command (one that the drive is to confirm, and one for a stop requested after other commands),
 * plus one for the watchdog.
 */
#define DB_QUEUE_STOPS_EACH 7

/* `commands` places for everything but stops, and places for the stops of `drives` drives. */
int db_queue_new(size_t commands, size_t drives, struct db_queue **queue);
void db_queue_free(struct db_queue *queue);

/* Network thread, also while the bus works: makes room for the stops of at least `drives` drives.
 * The room never shrinks. 0 or -ENOMEM. */
int db_queue_grow(struct db_queue *queue, size_t drives);

/* Network thread. Copies the request with its arguments or settings and returns the copy; null when
 * no place is free for this kind of request, or for stops of this drive. A stop loses its
 * arguments. */
struct db_request *db_queue_post(struct db_queue *queue, const struct db_request *request);
/* Network thread. Requests posted between true and false become visible to the bus together, at
 * false. Returns whether there are any. */
bool db_queue_gather(struct db_queue *queue, bool gathers);
/* Network thread: a request that has ended, once; null when there is none. */
struct db_request *db_queue_collect(struct db_queue *queue);
/* Network thread: its place is free. */
void db_queue_release(struct db_request *request);

/* Bus thread: the oldest request not taken yet, or null. The bus owns the request until it is
 * finished. */
struct db_request *db_queue_take(struct db_queue *queue);
/* Bus thread, not for a stop: a buffer of DB_REQUEST_MAX bytes for what is sent for this request.
 * It stays readable after the request has finished, but may then belong to another request. */
uint8_t *db_queue_bytes(const struct db_request *request);
/* Bus thread: the parts of a parameter write, the request's own part first. */
struct db_write_part *db_queue_parts(const struct db_request *request);
/* Bus thread: a parameter write becomes a part of another one and ends together with it, with the
 * result of its part where the driver has reported one. */
void db_queue_join(struct db_request *request, struct db_request *more);
/* Bus thread: makes visible to the network thread what the driver reports as acknowledged. */
void db_queue_show_acknowledged(struct db_request *request);
/* Bus thread: the request's command is on the wire (the first time counts). */
void db_queue_note_sent(struct db_request *request, db_time now);
/* Bus thread: ends a request and those that joined it; none may be used afterwards. */
void db_queue_finish(struct db_request *request, enum db_result result, db_time now);

/* Bus thread: true if requests were finished since the last call, so that the network thread must
 * be notified. */
bool db_queue_has_finished(struct db_queue *queue);

#endif
