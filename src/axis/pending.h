/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The requests of one drive that its bus has. A bus takes a certain number of commands and
 * parameter writes, whoever's they are: so its drives share the room for them. Room for stops is
 * each drive's own, and no other request can take it. Network thread only; allocates only where a
 * drive is made.
 */
#ifndef DRIVEBRIDGE_AXIS_PENDING_H
#define DRIVEBRIDGE_AXIS_PENDING_H

#include "drivebridge/commander.h"

struct db_waiter {
	struct db_write_token token;
	db_time deadline;
};

/* One request. */
struct db_slot {
	struct db_slot *next; /* another one of the drive's, or a free one */
	uint32_t ticket;      /* 0: free */
	uint32_t order;
	uint32_t entry;     /* its number in the history */
	uint32_t ends_trip; /* the trip of the watchdog whose latch it ends; 0: none */
	db_time arrived;
	uint8_t address[16]; /* of the client whose it is */
	uint16_t port;
	uint16_t id;                   /* command_id */
	enum db_command command : 8;   /* NONE: a parameter write */
	enum db_stand_cause cause : 4; /* of a stop */
	bool has_client : 1;           /* it is not the bridge's own */
	bool overtaken : 1;            /* a stop was handed to the bus after it */
	bool reaction : 1;             /* the stop for clients that are missed */
	bool held : 1;                 /* its client holds what it begins */
	bool halts : 1;                /* a move at speed 0, whose end is to stand */
	bool again : 1; /* a stop that is to be handed to the bus once more when it ended */
	bool over : 1;  /* ... and has ended */
	unsigned waiter_count : 3;
	uint8_t delay; /* of a program: s before it begins */
	struct db_waiter waiters[DB_COMMANDER_WAITERS];
};

/* For all but the stops of the drives of one bus. */
struct db_room;

struct db_pending {
	struct db_slot *first; /* the youngest come first */
	struct db_room *room;
	unsigned commands; /* so many of the room's are this drive's */
	struct db_slot stops[DB_COMMANDER_STOPS];
};

/* Room of its own for so many requests, or the neighbour's, a drive's on the same bus. 0 or
 * -ENOMEM. */
int db_pending_init(struct db_pending *pending, size_t commands,
                    const struct db_pending *neighbour);
/* What the drive has of the room is the others' again. */
void db_pending_release(struct db_pending *pending);

/* A place for such a request, or null. It is only taken by db_pending_add(). */
struct db_slot *db_pending_place(struct db_pending *pending, enum db_command command);
/* Takes the place; `request` is what stands there from now on, its `next` aside. */
void db_pending_add(struct db_pending *pending, struct db_slot *place,
                    const struct db_slot *request);
void db_pending_remove(struct db_pending *pending, struct db_slot *slot);

/* Null: there is none. */
struct db_slot *db_pending_find(const struct db_pending *pending, uint32_t ticket);

/* Whose it is: address and port, put into `client`; null: the bridge's own. */
const struct db_client *db_slot_client(const struct db_slot *slot, struct db_client *client);

#endif
