/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The only way of commands between the network thread and one bus thread: a fixed set of slots, each
 * owned by one side at a time. The network fills a free slot; the bus works on it in place and marks
 * it done; the network collects the result, which frees the slot. The bus allocates nothing, and
 * nothing can overflow: a completion lives in the slot of its own request.
 */
#ifndef DRIVEBRIDGE_SCHED_QUEUE_H
#define DRIVEBRIDGE_SCHED_QUEUE_H

#include "drivebridge/command.h"
#include "drivebridge/driver.h"

#include <stdbool.h>
#include <stddef.h>

struct db_queue;
struct db_queued; /* one request, while the bus has it */

/*
 * Room of each drive's own for stops, which no other drive can take: two of each kind (one that the
 * drive is to confirm, and one that came behind what was asked for in between), and the watchdog's.
 */
#define DB_QUEUE_STOPS_EACH 7

/* `commands` slots for everything but stops, and those for the stops of so many drives. */
int db_queue_new(size_t commands, size_t drives, struct db_queue **queue);
void db_queue_free(struct db_queue *queue);

/* Network thread, also while the bus works: room for the stops of at least so many drives. There is
 * never less than before. 0 or -ENOMEM. */
int db_queue_grow(struct db_queue *queue, size_t drives);

/* Network thread. False when no slot is free for this kind of request, or for stops of this drive. */
bool db_queue_post(struct db_queue *queue, const struct db_request *request);
/* Network thread. What is posted from true to false the bus sees all at once, at false; whether that
 * is anything. */
bool db_queue_gather(struct db_queue *queue, bool gathers);
/* Network thread. False when no completion waits. */
bool db_queue_collect(struct db_queue *queue, struct db_completion *completion);

/* Bus thread: the oldest request not taken yet, or null. The request stays the bus's until finished. */
struct db_queued *db_queue_take(struct db_queue *queue);
uint32_t db_queued_ticket(const struct db_queued *queued);
uint16_t db_queued_drive(const struct db_queued *queued);
/* NONE: parameters. */
enum db_command db_queued_command(const struct db_queued *queued);
/* Of a stop. */
enum db_stand_cause db_queued_cause(const struct db_queued *queued);
/* All of it; null for a stop, which has no more than the above. */
const struct db_request *db_queued_request(const struct db_queued *queued);
/* Bus thread, not for a stop: room for DB_REQUEST_MAX bytes that it sends for this request. They stay
 * readable after the request was finished, but may then be another's. */
uint8_t *db_queued_bytes(struct db_queued *queued);
/* Bus thread: the request's command is on the wire (the first time counts). */
void db_queued_sent(struct db_queued *queued, db_time now);
/* Bus thread: ends a request; it must not be used afterwards. */
void db_queued_finish(struct db_queued *queued, enum db_result result, db_time now);

/* Bus thread: whether requests were finished since the last call, so that the network must be told. */
bool db_queue_take_finished(struct db_queue *queue);

#endif
