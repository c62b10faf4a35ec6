/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commander of one drive: decides which writes become requests to the bus, which are answered
 * from memory, and when their writers are answered. It is where "never executed twice" is kept.
 *
 * Network thread only. No clock, no I/O, no allocation but in db_commander_new() and
 * db_commander_reserve(); `now` is handed in.
 *
 * `client` is who asks; null: nobody in particular (the vendor's layout), who has no ids.
 *
 * command_id
 *   - 0: the write executes, each time.
 *   - Other: it executes when it differs from the drive's last id. The same id again is not
 *     executed and is answered as the first time; while that command is pending, together with it.
 *   - The first id after the start is only remembered (restarted).
 *   - Every outcome uses an id up, except busy: a writer that found the queue full may repeat its
 *     write as it is.
 *   - stop, quick_stop and disable always execute. One that repeats the drive's newest command while
 *     that is still pending joins it. One that comes behind something else is handed to the bus
 *     anew, and who waits for the older one of its kind waits for this one. So a drive never has
 *     more than two of a kind with its bus, and there is always room for a stop: a third one is
 *     handed over when the second ended, and until then other commands are answered as busy.
 *
 *   With ids_by_client "last id" is that of the client's address: each numbers its own commands,
 *   and the first of each is only remembered. The last 8 addresses that command the drive are
 *   known; one that is forgotten begins anew. Without, there is one memory for all clients.
 *
 * Results
 *   With ids_by_client a client whose address has commanded the drive is shown the result of its
 *   own latest command and write, and whether its own motion is done or was aborted, by whomever.
 *   Others, and without ids_by_client everybody, are shown the latest of all.
 *
 * A write of `command` without `command_id` (one register, FC 6) uses the kept id when that was not
 * used yet. When it was, and command and arguments are those that were executed last, the write is
 * the same request sent again: it is not executed and is answered as that execution was; otherwise
 * it executes as if its id were 0.
 *
 * A write that is refused at once stores nothing.
 *
 * A motion is aborted when the drive has taken another one, or a stop is on its way. One that the
 * drive refuses leaves the motion before as it is, and that is followed to its end: result_id and
 * result are about the latest command, motion_id and motion_result about the latest motion.
 *
 * The watchdog is armed by the first motion command, or when the drive already moves as it is first
 * seen (the program was killed and started again), and fed by what the drive's configuration says:
 * reads of any client that may write, reads over connections that command the drive, commands that
 * are admitted and other writes of who commands, or changes of the heartbeat; as of when they
 * arrived. A write that is refused feeds nothing, nor do arguments alone; the command_id of before again
 * only from an address that commands. When it expires, the configured
 * stop goes to the bus ahead of everything and motion is refused (latched) until clear_fault.
 *
 * A motion is held when the client says so (db_commander_execute_held()), or when hold_ms of the
 * command block is not 0; then a beat is a write of another hold_beat than before, and a command that is
 * written again is none. After a lost hold the next one needs another hold_beat than that was lost
 * with: what an I/O scanner repeats for a program that has died begins nothing.
 *
 * A held motion is stopped as soon as its holder is missed: when no beat came for the span of its
 * hold, or its connection ended, whatever the watchdog says, also where there is none. The stop is
 * on_client_loss, or stop where that is none; nothing is latched. The same client may command other
 * motions meanwhile and goes on holding; another motion that the drive takes and nobody holds, and
 * any stop, ends the hold.
 */
#ifndef DRIVEBRIDGE_COMMANDER_H
#define DRIVEBRIDGE_COMMANDER_H

#include "drivebridge/axis.h"
#include "drivebridge/client.h"
#include "drivebridge/command.h"
#include "drivebridge/driver.h"
#include "drivebridge/history.h"

struct db_commander;

/* A write that did not bring about what its writer wanted. */
struct db_refused_write {
	enum db_command command; /* NONE: parameters, or another register */
	const char *param;       /* the first of the parameters; null: not known */
	uint16_t address;        /* the register that it was refused for; 0: not known */
	enum db_result result;
};

struct db_commander_ops {
	/* Hands a request to the bus, which copies it. False when its queue is full; never for a
	 * stop, see DB_COMMANDER_STOPS. */
	bool (*submit)(void *context, const struct db_request *request);
	/* Answers a write that was to be answered later. Exactly once for each. */
	void (*answer)(void *context, struct db_write_token token, enum db_result result);
	/* For the history: */
	uint64_t (*wall_us)(void *context); /* since 1970-01-01 UTC */
	/* For the log: each refusal once, not what is answered from memory. `client` is null for
	 * the bridge's own; of others only address and port hold. Not logged are what was cancelled,
	 * what others tell of (a client that is not in control, a drive that runs on), and what is
	 * on its way. May be null. */
	void (*refused)(void *context, const struct db_client *client,
	                const struct db_refused_write *write);
	/* The drive is told to stop because the holder of its motion is missed; `gone`: its
	 * connection has ended. May be null. */
	void (*hold_lost)(void *context, const struct db_client *holder, bool gone);
};

struct db_commander_config {
	const struct db_driver *driver;
	const struct db_bus_config *bus_config;     /* for the driver's check() */
	const struct db_drive_config *drive_config; /* likewise */
	/* The commander of another drive of this bus, whose room for commands and parameter writes
	 * it shares: as many as the bus takes. Null: there is none. */
	const struct db_commander *neighbour;
	uint64_t commands; /* db_driver_commands() */
	const struct db_axis *axis;
	uint16_t drive;     /* 0..65534; see struct db_bus_drive. Makes tickets unique */
	bool ids_by_client; /* command-id-scope = client */
	unsigned confirm_ms;
	bool accept_writes;   /* answer success at once; the result registers tell the end */
	uint32_t watchdog_ms; /* 0 = off */
	enum db_command
		on_client_loss; /* the stop that expiry sends; NONE = there is no watchdog */
};

/* The command block of the registers, as kept for this drive. */
struct db_command_block {
	uint16_t command_id;
	uint16_t command;
	struct db_args args;
	uint16_t staged_command; /* waits, with the arguments as they are then, for group_start */
	uint16_t hold_ms; /* a motion is held by who writes its command; 0: it goes on by itself */
	uint16_t hold_beat; /* another value than before is a beat of its holder */
};

/* One write into the command block: the kept block with the written registers put over it. */
struct db_command_write {
	struct db_command_block block;
	bool has_command; /* `command` was among the written registers */
	bool has_id;      /* `command_id` was */
	bool has_staged;  /* `staged_command` was */
	bool has_beat;    /* `hold_beat` was */
};

/* What became of somebody's commands, as the result registers show it. */
struct db_command_results {
	uint32_t result_time_us; /* from the arrival of the last ended command to its end */
	uint16_t result_id;
	/* enum db_result of the latest command. OK says that the drive has begun it. A motion with
	 * an end (a position move, homing, shaking) is followed to that: `done` when it came there,
	 * FAILED, CANCELLED or INDETERMINATE here when it did not. */
	uint16_t result;
	uint16_t result_command;
	uint16_t result_limit;   /* enum db_limit, when result is `limit` */
	uint16_t write_result;   /* enum db_result of the latest command or parameter write */
	uint16_t write_register; /* the first register that it was refused for; 0: not known */
	uint16_t aborted_id;     /* of the motion that `aborted` is about */
	uint16_t motion_id;      /* of the motion that the drive has begun last */
	uint16_t motion_result;  /* enum db_result: PENDING while it goes on, OK: at its end */
	bool done;               /* the newest motion that was asked for came to its end */
	bool aborted;            /* a motion was ended by the latest command before its end */
};

/* What a client is shown of a drive's commands. */
struct db_command_state {
	struct db_command_results results;
	uint16_t active_command; /* oldest command pending, 0 = none */
	bool busy;               /* a command or parameter write is pending */
	bool latched;            /* the watchdog tripped; motion is refused until clear_fault */
	db_time latched_since;   /* while it is */
	uint32_t watchdog_ms;
	uint32_t watchdog_remaining_ms; /* 0 while nothing moves it */
	uint32_t watchdog_trips;
};

/* How long a hold may last without a beat, in milliseconds. */
#define DB_HOLD_MIN_MS 100
#define DB_HOLD_MAX_MS 1000

/* Requests of one drive that may be pending, if its bus takes so many. */
#define DB_COMMANDER_PENDING 16

/* Stops have places of their own: two of each kind for clients, and the watchdog's. A bus has room
 * for as many of each of its drives, so that it takes every stop. */
#define DB_COMMANDER_STOPS_OF_A_KIND 2
#define DB_COMMANDER_STOPS (3 * DB_COMMANDER_STOPS_OF_A_KIND + 1)

/* Writers that may wait for one request; more are answered as pending at once. */
#define DB_COMMANDER_WAITERS 4
#define DB_COMMANDER_WAITERS_MASK 7

/* The driver, axis and context must outlive it. 0 or -ENOMEM. */
int db_commander_new(const struct db_commander_config *config, const struct db_commander_ops *ops,
                     void *context, struct db_commander **commander);
void db_commander_free(struct db_commander *commander);

/*
 * How writers are answered from now on; those that wait keep their time. When ids_by_client
 * changes, all ids are forgotten: the next of each is only a baseline. Memory for that is reserved
 * before; it is given back when ids are the drive's again.
 */
int db_commander_reserve(struct db_commander *commander, bool ids_by_client); /* 0 or -ENOMEM */
void db_commander_set_writers(struct db_commander *commander, unsigned confirm_ms,
                              bool accept_writes, bool ids_by_client);

/* The drive is taken out: answers everybody who still waits, as cancelled. */
void db_commander_dismiss(struct db_commander *commander);

/* The following four carry out a write, or say why not. */

struct db_write_answer db_commander_write(struct db_commander *commander,
                                          const struct db_client *client,
                                          const struct db_command_write *write,
                                          struct db_write_token token, db_time now);

/* The command that waits for the group's start; NONE. */
enum db_command db_commander_staged(const struct db_commander *commander);
/* Carries it out with the kept arguments, as db_commander_execute() does; there must be one.
 * `group`: see struct db_request. */
struct db_write_answer db_commander_start_staged(struct db_commander *commander,
                                                 const struct db_client *client, uint32_t group,
                                                 struct db_write_token token, db_time now);

/* Ticket of the request that the newest command became; 0: none yet. */
uint32_t db_commander_newest(const struct db_commander *commander);

/* A command from outside the command block (coils): no id, the kept block stays as it is. */
struct db_write_answer db_commander_execute(struct db_commander *commander,
                                            const struct db_client *client, enum db_command code,
                                            const struct db_args *args, struct db_write_token token,
                                            db_time now);

/* The same of a motion that this client holds from now on: until a beat is missing for hold_ms
 * (0: it goes on by itself), or the connection ends. */
struct db_write_answer db_commander_execute_held(struct db_commander *commander,
                                                 const struct db_client *client,
                                                 enum db_command code, const struct db_args *args,
                                                 uint32_t hold_ms, struct db_write_token token,
                                                 db_time now);
/* The holder gives a sign of life. False: this client holds nothing, or not any more. */
bool db_commander_beat(struct db_commander *commander, const struct db_client *client, db_time now);
/* It sends nothing any more: what it holds is stopped with the next db_commander_expire(). */
void db_commander_desert(struct db_commander *commander, const struct db_client *client,
                         db_time now);

/* Values that were checked already; 1..DB_SETTINGS_MAX of them, carried out as one request. */
struct db_write_answer db_commander_set(struct db_commander *commander,
                                        const struct db_client *client,
                                        const struct db_setting *settings, size_t count,
                                        struct db_write_token token, db_time now);

/* A write was refused for its form before it came here: for write_result only. `address`: of the
 * register that it was refused for; 0: for none in particular. */
void db_commander_set_refused(struct db_commander *commander, const struct db_client *client,
                              enum db_result result, uint16_t address);
/* A command, or with NONE a parameter write, was refused before it came here: for the history,
 * too. */
void db_commander_refuse(struct db_commander *commander, const struct db_client *client,
                         const struct db_command_block *block, enum db_result result,
                         uint16_t address);

/* Ports of set_output that are known to be inputs, bit 0 = port 1: a set_outputs with one of them
 * is refused as a whole. */
unsigned db_commander_input_ports(const struct db_commander *commander);

/* It addressed this drive: of those with a memory of their own the silent are forgotten first. */
void db_commander_hear(struct db_commander *commander, const struct db_client *client, db_time now);

/* A client who may write addressed this drive, `by` what is said, at the time `arrived`: it is not
 * alone. What the commander itself carries out it takes care of. */
void db_commander_feed(struct db_commander *commander, const struct db_client *client,
                       enum db_watchdog_feed by, db_time arrived);
/* Who fed the watchdog last, and may have gone since; DB_CLIENT_NOBODY: nobody did. */
const struct db_client *db_commander_fed_by(const struct db_commander *commander);
void db_commander_set_watchdog(struct db_commander *commander, uint32_t timeout_ms,
                               db_time arrived);
/* Its connection has ended: its number may become another's. What it held is deserted. */
void db_commander_forget(struct db_commander *commander, const struct db_client *client,
                         db_time now);

/* The stop that is owed to the drive if this program ended now: one that is pending, or that of a held motion, which
 * nobody would hold any more. NONE: there is none. */
enum db_command db_commander_owed_stop(const struct db_commander *commander);
/* Nobody can hold it any more: what is held is stopped now. */
void db_commander_end_hold(struct db_commander *commander, db_time now);
/* The drive must stand, for a cause of the bridge's own. */
void db_commander_stand(struct db_commander *commander, enum db_command stop,
                        enum db_stand_cause cause, db_time now);

/* The bus ended a request. Unknown tickets are ignored. */
void db_commander_complete(struct db_commander *commander, const struct db_completion *completion,
                           db_time now);

/* When db_commander_expire() is due; DB_TIME_NEVER. */
db_time db_commander_next_deadline(const struct db_commander *commander);
/* Answers the writers whose time is up (their requests stay pending) and runs the watchdog. Whether
 * that tripped now. */
bool db_commander_expire(struct db_commander *commander, db_time now);

/* The largest target_velocity that the configuration allows, either way; NAN: it does not say, or the drive has
 * yet to tell its scale. */
double db_commander_max_velocity(const struct db_commander *commander);

/* age 0 is the newest; false: there are not so many. */
bool db_commander_history(const struct db_commander *commander, size_t age,
                          struct db_history_entry *entry);

/* What became of the command with this number in the history, and of the motion that it began: PENDING while
 * that goes on. INDETERMINATE: it is not remembered any more. */
enum db_result db_commander_outcome(const struct db_commander *commander, uint32_t entry);

/* The block as this client finds it: the arguments are everybody's, the id may be its own. */
struct db_command_block db_commander_kept(struct db_commander *commander,
                                          const struct db_client *client);
void db_commander_state(struct db_commander *commander, const struct db_client *client,
                        struct db_command_state *state, db_time now);

/* Number of the drive that a ticket belongs to. */
uint16_t db_ticket_drive(uint32_t ticket);

#endif
