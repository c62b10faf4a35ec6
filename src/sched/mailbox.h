/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The only way of commands between the network thread and one bus thread: a fixed set of slots, each
 * owned by one side at a time. The network fills a free slot; the bus works on it in place and marks
 * it done; the network collects the result, which frees the slot. The bus allocates nothing, and
 * nothing can overflow: a completion lives in the slot of its own request.
 */
#ifndef DRIVEBRIDGE_SCHED_MAILBOX_H
#define DRIVEBRIDGE_SCHED_MAILBOX_H

#include "drivebridge/command.h"
#include "drivebridge/driver.h"

#include <stdbool.h>
#include <stddef.h>

struct db_mailbox;
struct db_letter; /* one request, while the bus has it */

/*
 * Room of each drive's own for stops, which no other drive can take: two of each kind (one that the
 * drive is to confirm, and one that came behind what was asked for in between), and the watchdog's.
 */
#define DB_MAILBOX_STOPS_EACH 7

/* `commands` slots for everything but stops, and those for the stops of so many drives. */
int db_mailbox_new(size_t commands, size_t drives, struct db_mailbox **mailbox);
void db_mailbox_free(struct db_mailbox *mailbox);

/* Network thread, also while the bus works: room for the stops of at least so many drives. There is
 * never less than before. 0 or -ENOMEM. */
int db_mailbox_grow(struct db_mailbox *mailbox, size_t drives);

/* Network thread. False when no slot is free for this kind of request, or for stops of this drive. */
bool db_mailbox_post(struct db_mailbox *mailbox, const struct db_request *request);
/* Network thread. False when no completion waits. */
bool db_mailbox_collect(struct db_mailbox *mailbox, struct db_completion *completion);

/* Bus thread: the oldest letter not taken yet, or null. The letter stays the bus's until finished. */
struct db_letter *db_mailbox_take(struct db_mailbox *mailbox);
uint32_t db_letter_ticket(const struct db_letter *letter);
uint16_t db_letter_axis(const struct db_letter *letter);
/* NONE: parameters. */
enum db_command db_letter_command(const struct db_letter *letter);
/* All of it; null for a stop, which has no more than the above. */
const struct db_request *db_letter_request(const struct db_letter *letter);
/* Bus thread, not for a stop: room for DB_REQUEST_MAX bytes that it sends for this letter. They stay
 * readable after the letter was finished, but may then be another's. */
uint8_t *db_letter_bytes(struct db_letter *letter);
/* Bus thread: the letter's command is on the wire (the first time counts). */
void db_letter_sent(struct db_letter *letter, db_time now);
/* Bus thread: ends a letter; it must not be used afterwards. */
void db_letter_finish(struct db_letter *letter, enum db_result result, db_time now);

/* Bus thread: whether letters were finished since the last call, so that the network must be told. */
bool db_mailbox_take_finished(struct db_mailbox *mailbox);

#endif
