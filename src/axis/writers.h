/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What one drive remembers of those who command it: which command ids were used, and what became of
 * their commands. One memory for all, or one for each client address; then of the last so many
 * addresses, and the one that was silent longest is forgotten. Who was forgotten is new again: its
 * next id is only a baseline, so forgetting executes nothing. Beside them what became of the latest
 * command, whoever's it was. Pure: one thread, no clock.
 */
#ifndef DRIVEBRIDGE_AXIS_WRITERS_H
#define DRIVEBRIDGE_AXIS_WRITERS_H

#include "drivebridge/commander.h"
#include "drivebridge/limit.h"

/* Addresses that are remembered. */
#define DB_WRITERS 8

/* A command id that was used, and what became of it. */
struct db_used_id {
	uint32_t ticket;
	uint16_t id; /* 0: a command without */
	enum db_result result : 8;
	bool sent : 1; /* it went to the bus */
};

/* What became of somebody's commands and of the motion that they began. */
struct db_outcome {
	struct db_command_results results;
	bool motion_ends;    /* the motion has an end of its own */
	bool motion_refused; /* another one was asked for since, and not begun: `done` is not its */
	uint32_t ticket;     /* the command that `result` is about */
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
	bool commanded;                   /* `own` holds something */
	struct db_outcome own;            /* of its own commands */
};

struct db_writers {
	bool by_address;
	struct db_outcome latest; /* of the latest command, whoever wrote it */
	struct db_writer all;     /* everybody's */
	struct db_writer
		*each; /* DB_WRITERS of them, while it is by address; null: no memory for that */
};

/* Zeroed memory is for everybody. 0 or -ENOMEM; it changes nothing that is remembered. */
int db_writers_reserve(struct db_writers *writers);
/* Forgets the writers. What is by address is reserved before. */
void db_writers_set(struct db_writers *writers, bool by_address);
void db_writers_release(struct db_writers *writers);

/* Null when this client has commanded nothing that is remembered. Without by_address there is one
 * for everybody, and for no client (null), too. */
struct db_writer *db_writers_find(struct db_writers *writers, const struct db_client *client);
/* The same, and makes it; null only for no client. */
struct db_writer *db_writers_claim(struct db_writers *writers, const struct db_client *client,
                                   db_time now);
void db_writers_hear(struct db_writers *writers, const struct db_client *client, db_time now);

/* What this client is shown: of its own latest command if it has one that is remembered, else of
 * the latest of all. */
const struct db_command_results *db_writers_results(struct db_writers *writers,
                                                    const struct db_client *client);

/* A ticket is given out anew: whatever it meant before is over. */
void db_writers_retire(struct db_writers *writers, uint32_t ticket);
/* Another request took the place of this one: what was remembered of it is about that from now
 * on. */
void db_writers_retarget(struct db_writers *writers, uint32_t ticket, uint32_t to);

/*
 * The following are about the latest command of all and, where `writer` is not null, its own.
 * `ticket` is the request that it became; 0: none.
 */

/* How a write stands, refused for this register; 0: for none. */
void db_writers_set_write(struct db_writers *writers, struct db_writer *writer,
                          enum db_result result, uint16_t refused_register, uint32_t ticket);
/* The same of a command; one with an id uses that up, unless it was turned away as busy. */
void db_writers_set_command(struct db_writers *writers, struct db_writer *writer, uint16_t id,
                            uint16_t command, enum db_result result, uint32_t ticket);
void db_writers_set_limit(struct db_writers *writers, struct db_writer *writer,
                          enum db_limit limit);
/* It went to the bus, or ended without: what a bare repetition of it is compared with. */
void db_writer_set_executed(struct db_writer *writer, const struct db_command_block *block,
                            uint16_t id, enum db_result result, uint32_t ticket);

/* A request ended. */
void db_writers_complete(struct db_writers *writers, uint32_t ticket, enum db_result result,
                         uint32_t took_us);

/* Another motion was asked for: `done` and `aborted` are about that from now on. */
void db_writers_ask_motion(struct db_writers *writers, struct db_writer *writer);
/* ... by joining a stop that is under way: of that only its own outcome is new. */
void db_writer_ask_motion(struct db_writer *writer);
/* ... and was not begun. */
void db_writers_refuse_motion(struct db_writers *writers, struct db_writer *writer);
/* The drive has begun a motion; `cancelled`: another command had overtaken it by then. */
void db_writers_begin_motion(struct db_writers *writers, struct db_writer *writer, uint16_t id,
                             bool ends, bool cancelled);

/* Whatever goes on is ended by another command; told to who began it. */
void db_writers_cancel_motion(struct db_writers *writers);
/* What goes on came to its end by itself; `ticket` is its command's. */
void db_writers_end_motion(struct db_writers *writers, uint32_t ticket, enum db_result result);

#endif
