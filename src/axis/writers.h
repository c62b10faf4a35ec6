/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What one drive remembers of those who command it: which command ids were used, and what became of
 * their commands. One memory for all, or one for each client address; then of the last so many
 * addresses, and the one that was silent longest is forgotten. Who was forgotten is new again: its
 * next id is only a baseline, so forgetting executes nothing. Pure: one thread, no clock.
 */
#ifndef DRIVEBRIDGE_AXIS_WRITERS_H
#define DRIVEBRIDGE_AXIS_WRITERS_H

#include "drivebridge/commander.h"

/* Addresses that are remembered. */
#define DB_WRITERS 8

/* A command id that was used, and what became of it. */
struct db_used_id {
	uint32_t ticket;
	uint16_t id; /* 0: a command without */
	enum db_result result : 8;
	bool sent : 1; /* it went to the bus */
};

/* What the result registers tell; the members are those of struct db_command_state. */
struct db_outcome {
	uint16_t result_id;
	uint16_t result;
	uint16_t result_command;
	uint16_t write_result;
	uint16_t write_register;
	uint32_t result_time_us;
	uint16_t result_limit;
	uint16_t aborted_id;
	uint16_t motion_id;
	uint16_t motion_result;
	bool motion_ends; /* the motion has an end of its own */
	bool motion_refused; /* another one was asked for since, and not begun: `done` is not about it */
	bool done;
	bool aborted;
	uint32_t ticket;       /* the command that `result` is about */
	uint32_t write_ticket; /* the request that `write_result` is about */
};

struct db_writer {
	db_time heard;
	uint8_t address[16];
	uint16_t kept_id; /* the command_id that it wrote last */
	bool taken;
	struct db_used_id last;     /* id 0: no id was seen yet */
	struct db_used_id previous; /* to fall back to when the bus turns `last` away as busy */
	bool has_executed;          /* the following hold something */
	struct db_command_block executed; /* its newest command that went to the bus */
	struct db_used_id execution;      /* ... and what became of that */
	bool commanded;                   /* `shown` holds something */
	struct db_outcome shown;
};

struct db_writers {
	bool by_address;
	struct db_writer all; /* everybody's */
	struct db_writer
		*each; /* DB_WRITERS of them, while it is by address; null: no memory for that */
};

/* Zeroed memory is for everybody. 0 or -ENOMEM; it changes nothing that is remembered. */
int db_writers_reserve(struct db_writers *writers);
/* Forgets everything. What is by address is reserved before. */
void db_writers_set(struct db_writers *writers, bool by_address);
void db_writers_release(struct db_writers *writers);

/* Null when this client has commanded nothing that is remembered. Without by_address there is one
 * for everybody, and for no client (null), too. */
struct db_writer *db_writers_find(struct db_writers *writers, const struct db_client *client);
/* The same, and makes it; null only for no client. */
struct db_writer *db_writers_claim(struct db_writers *writers, const struct db_client *client,
                                   db_time now);
void db_writers_hear(struct db_writers *writers, const struct db_client *client, db_time now);

/* A ticket is given out anew: whatever it meant before is over. */
void db_writers_retire(struct db_writers *writers, uint32_t ticket);
void db_outcome_retire(struct db_outcome *outcome, uint32_t ticket);

/* Another request took the place of this one: what was remembered of it is about that from now on. */
void db_writers_retarget(struct db_writers *writers, uint32_t ticket, uint32_t to);
void db_outcome_retarget(struct db_outcome *outcome, uint32_t ticket, uint32_t to);

void db_writer_remember(struct db_writer *writer, uint16_t id, enum db_result result,
                        uint32_t ticket);

/* A request ended. */
void db_writers_complete(struct db_writers *writers, uint32_t ticket, enum db_result result,
                         uint32_t took_us);
void db_outcome_complete(struct db_outcome *outcome, uint32_t ticket, enum db_result result,
                         uint32_t took_us);

/* Another motion was asked for: `done` and `aborted` are about that from now on. */
void db_outcome_ask_motion(struct db_outcome *outcome);
/* ... and was not begun. */
void db_outcome_refuse_motion(struct db_outcome *outcome);
/* The drive has begun a motion; `cancelled`: another command had overtaken it by then. */
void db_outcome_begin_motion(struct db_outcome *outcome, uint16_t id, bool ends, bool cancelled);
/* Whatever goes on is ended by another command; told to who began it. */
void db_outcome_cancel_motion(struct db_outcome *outcome);
void db_writers_cancel_motion(struct db_writers *writers);
/* What goes on came to its end by itself; `ticket` is its command's. */
void db_outcome_end_motion(struct db_outcome *outcome, uint32_t ticket, enum db_result result);
void db_writers_end_motion(struct db_writers *writers, uint32_t ticket, enum db_result result);

#endif
