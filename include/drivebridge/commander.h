/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commander of one drive: decides which writes become requests to the bus, which are answered
 * from memory, and when their writers are answered. It ensures that nothing is executed twice.
 *
 * Network thread only. No clock, no I/O, no allocation but in db_commander_new() and
 * db_commander_reserve(); `now` is passed in.
 *
 * `client` sent the request; null: no particular client (the vendor's layout), without ids.
 *
 * command_id
 *   - 0: the write executes, each time.
 *   - Other: it executes when it differs from the drive's last id. The same id again is not
 *     executed and is answered as the first time; while that command is pending, together with it.
 *   - The first id after the start is only remembered (restarted).
 *   - Every outcome uses an id up, except busy: a writer that found the queue full may repeat its
 *     write unchanged.
 *   - stop, quick_stop and disable always execute. A stop that repeats the drive's newest command
 *     while that is still pending joins it. A stop that arrives after another command is submitted
 *     to the bus again, and writers that wait for the older stop of its kind wait for this one. So
 *     a drive never has more than two of a kind at its bus, and there is always room for a stop: a
 *     third one is submitted when the second has ended, and until then other commands are answered
 *     as busy.
 *
 *   With ids_by_client "last id" is that of the client's address: each numbers its own commands,
 *   and the first of each is only remembered. The last 8 addresses that command the drive are
 *   known; a forgotten one counts as new. Without ids_by_client there is one record for all
 *   clients.
 *
 * Results
 *   With ids_by_client a client whose address has commanded the drive is shown the result of its
 *   own latest command and write, and whether its own motion is done or was aborted, by any client.
 *   All others, and without ids_by_client all clients, are shown the latest results of all.
 *
 * A write of `command` without `command_id` (one register, FC 6) uses the kept id when that was not
 * used yet. When it was, and command and arguments are those that were executed last, the write is
 * a repeat of the same request: it is not executed and is answered as that execution was; otherwise
 * it executes as if its id were 0.
 *
 * A write that is refused at once stores nothing.
 *
 * A motion is aborted when the drive has accepted another one, or a stop was submitted. A motion
 * that the drive refuses does not affect the earlier one, which is followed to its end: result_id
 * and result are about the latest command, motion_id and motion_result about the latest motion.
 *
 * The watchdog is armed by the first motion command, or when the drive already moves as it is first
 * seen (the program was killed and started again). It is fed as the drive's configuration says: by
 * reads of any client that may write, by reads over connections that command the drive, by admitted
 * commands and other writes of clients that command the drive, or by changes of the heartbeat; the
 * time of arrival counts. A refused write does not feed it, nor do arguments alone; the previous
 * command_id again only from an address that commands the drive. When it expires, the configured
 * stop goes to the bus ahead of everything and motion is refused (latched) until clear_fault.
 *
 * A motion is held when the client says so (hold_ms of db_commander_ask()), or when hold_ms of the
 * command block is not 0; then a beat is a write that changes hold_beat, and a repeated command is
 * none. After a lost hold the next one needs another hold_beat than the one at which it was lost: a
 * write that an I/O scanner repeats for a program that has died begins nothing.
 *
 * A held motion is stopped as soon as its holder is missed: when no beat came for the span of its
 * hold, or its connection ended, whatever the watchdog says, also where there is none. The stop is
 * on_client_loss, or stop where that is none; nothing is latched. The same client may command other
 * motions meanwhile and continues to hold; another motion that the drive accepts without a hold,
 * and any stop, ends the hold.
 */
#ifndef DRIVEBRIDGE_COMMANDER_H
#define DRIVEBRIDGE_COMMANDER_H

#include "drivebridge/axis.h"
#include "drivebridge/client.h"
#include "drivebridge/command.h"
#include "drivebridge/driver.h"

struct db_commander;

/* One entry of a drive's history, as the registers show it. */
/* Number of entries kept for each drive. */
#define DB_HISTORY_MAX 32

/* As the number of a parameter: not determined. */
#define DB_HISTORY_UNKNOWN UINT16_MAX

struct db_history_entry {
	uint64_t timestamp_us; /* when the request arrived, us since 1970-01-01 UTC */
	uint32_t sequence;     /* from 1; 0: no entry */
	uint8_t address[16];   /* the client's, IPv4 v4-mapped; all 0: the bridge itself */
	uint16_t port;         /* the client's, 0: the bridge itself */
	uint16_t command_id;
	uint16_t command;     /* 0: a parameter write */
	uint16_t result;      /* enum db_result */
	uint32_t duration_us; /* from its arrival to that result */
	uint16_t repeats;     /* number of repeats */
	/* Arguments of the command. */
	uint16_t number;    /* output_number, output_mask, program_number; or the first parameter */
	int32_t position;   /* target_position, shake_start_position */
	int32_t position_2; /* shake_end_position */
	float real;         /* target_velocity, target_current, shake_frequency */
	uint32_t value;     /* output_value, output_levels, shake_cycles, shake_time, program_delay;
	                     * or the bits of the first parameter's new value */
};

/* A register that a PLC's program changes as a sign of life. */
struct db_heartbeat {
	uint8_t writer[16]; /* address of the client, as in struct db_client; zero: none yet */
	uint16_t value;
};

/*
 * A value was written. True when the same client had written a different one before: if two clients
 * write it, one of them dead, the values alternate, too.
 */
bool db_heartbeat_write(struct db_heartbeat *heartbeat, const uint8_t writer[16], uint16_t value);

/* A write that did not achieve what its writer wanted. */
struct db_refused_write {
	enum db_command command; /* NONE: parameters, or another register */
	const char *param;       /* the first of the parameters; null: not known */
	uint16_t address;        /* the register for which it was refused; 0: not known */
	/* the drive had acknowledged it, and was found later to hold another value: */
	bool holds_other;
	double held;
	/* a position move that rests this number of counts from its target; 0: it is none */
	double off;
	enum db_result result;
};

/* What was asked of a drive, for the audit trail. */
struct db_recorded {
	const struct db_request *request; /* no command and no settings: another register */
	/* PENDING: it went to the bus, and its end will be recorded. */
	enum db_result result;
	uint16_t address; /* the register for which it was refused; 0: none in particular */
	uint32_t joined;  /* the record of the pending stop that serves this one, too; 0: none */
};

struct db_commander_ops {
	/* Submits a request to the bus. Returns the bus's copy, which stays where it is until it is
	 * released; null when the queue is full, never for a stop, see DB_COMMANDER_STOPS. */
	struct db_request *(*submit)(void *context, const struct db_request *request);
	/* It has ended and its result is recorded: its place at the bus is free. */
	void (*release)(void *context, struct db_request *request);
	/* Answers a postponed write. Exactly once for each. */
	void (*answer)(void *context, struct db_write_token token, enum db_result result);
	/* For the history: */
	uint64_t (*wall_us)(void *context); /* since 1970-01-01 UTC */
	/* For the log: each refusal once, not those answered from memory. `client` is null for the
	 * bridge's own; for other clients only address and port are valid. Not logged: what was
	 * cancelled, what is reported elsewhere (a client that is not in control, a drive that does
	 * not stop), and what is pending. May be null. */
	void (*refused)(void *context, const struct db_client *client,
	                const struct db_refused_write *write);
	/* Records what was asked, in the order of time. Returns the number of the record, for its
	 * end; 0: there will be none. May be null, with the next one. */
	uint32_t (*record)(void *context, const struct db_recorded *recorded);
	/* A record's end, or a later one: a motion is accepted, and then it ends. */
	void (*record_end)(void *context, uint32_t record, enum db_result result, db_time took);
	/* The drive is stopped because the holder of its motion is missed; `gone`: its connection
	 * has ended. May be null. */
	void (*hold_lost)(void *context, const struct db_client *holder, bool gone);
};

struct db_commander_config {
	const struct db_driver *driver;
	const struct db_bus_config *bus_config;     /* for the driver's check() */
	const struct db_drive_config *drive_config; /* for the driver's check() */
	uint64_t commands;                          /* db_driver_commands() */
	const struct db_axis *axis;
	uint16_t drive;     /* 0..65534; see struct db_bus_drive. Makes tickets unique */
	bool ids_by_client; /* command-id-scope = client */
	unsigned confirm_ms;
	bool accept_writes;   /* answer success at once; the result registers show the end */
	uint32_t watchdog_ms; /* 0 = off */
	enum db_command on_client_loss; /* the stop sent when it expires; NONE: no watchdog */
};

/* The command block of the registers, as stored for this drive. */
struct db_command_block {
	uint16_t command_id;
	uint16_t command;
	struct db_args args;
	uint16_t staged_command; /* waits, with its arguments at that time, for group_start */
	/* a motion is held by the client that writes its command; 0: it continues without */
	uint16_t hold_ms;
	uint16_t hold_beat; /* a changed value is a beat of its holder */
};

/* A write into the command block: the stored block with the written registers applied. */
struct db_command_write {
	struct db_command_block block;
	bool has_command; /* `command` was among the written registers */
	bool has_id;      /* `command_id` was */
	bool has_staged;  /* `staged_command` was */
	bool has_beat;    /* `hold_beat` was */
};

/* The results of a client's commands, as the result registers show them. */
struct db_command_results {
	uint32_t result_time_us; /* from the arrival of the last ended command to its end */
	uint16_t result_id;
	/* enum db_result of the latest command. OK: the drive has begun it. A motion with an end (a
	 * position move, homing, shaking) is followed to that: `done` when it was reached, FAILED,
	 * CANCELLED or INDETERMINATE here when it was not. */
	uint16_t result;
	uint16_t result_command;
	uint16_t result_limit;   /* enum db_limit, when result is `limit` */
	uint16_t write_result;   /* enum db_result of the latest command or parameter write */
	uint16_t write_register; /* the first register for which it was refused; 0: not known */
	uint16_t aborted_id;     /* command_id of the motion that `aborted` is about */
	uint16_t motion_id;      /* command_id of the motion that the drive has begun last */
	/* enum db_result: PENDING while it continues, OK: it has reached its end */
	uint16_t motion_result;
	bool done;    /* the newest motion requested has reached its end */
	bool aborted; /* a motion was ended by the latest command before its end */
};

/* The state of a drive's commands as shown to a client. */
struct db_command_state {
	struct db_command_results results;
	uint16_t active_command; /* oldest command pending, 0 = none */
	bool busy;               /* a command or parameter write is pending */
	bool latched;            /* the watchdog tripped; motion is refused until clear_fault */
	db_time latched_since;   /* valid while latched */
	uint32_t watchdog_ms;
	uint32_t watchdog_remaining_ms; /* 0 while not armed */
	uint32_t watchdog_trips;
};

/* How long a hold may last without a beat, in milliseconds. */
#define DB_HOLD_MIN_MS 100
#define DB_HOLD_MAX_MS 1000

/* Maximum number of pending requests of a drive, if its bus takes that many. */
#define DB_COMMANDER_PENDING 16

/* Stops have places of their own: two of each kind for clients, and the watchdog's. A bus has room
 * for all of these for each drive, so that it takes every stop. */
#define DB_COMMANDER_STOPS_OF_A_KIND 2
#define DB_COMMANDER_STOPS (3 * DB_COMMANDER_STOPS_OF_A_KIND + 1)

/* The driver, axis and context must outlive it. 0 or -ENOMEM. */
int db_commander_new(const struct db_commander_config *config, const struct db_commander_ops *ops,
                     void *context, struct db_commander **commander);
void db_commander_free(struct db_commander *commander);

/*
 * How writers are answered from now on; for waiting ones the time stays. When ids_by_client
 * changes, all ids are forgotten: the next of each client is only a start value. Memory for that is
 * reserved before, and released when ids are per drive again.
 */
int db_commander_reserve(struct db_commander *commander, bool ids_by_client); /* 0 or -ENOMEM */
void db_commander_set_writers(struct db_commander *commander, unsigned confirm_ms,
                              bool accept_writes, bool ids_by_client);

/* The drive is removed: all waiting writers are answered as cancelled. */
void db_commander_dismiss(struct db_commander *commander);

/*
 * Carries out what `asked` says, or returns why not: a command with its arguments, or 1 to
 * DB_SETTINGS_MAX parameter values that were already checked. The caller fills in `client`,
 * `command` with `args` (null: none), or `settings` with `setting_count`, and `hold_ms` for a motion that the
 * client holds from now on: until a beat is missing for that long, or the connection ends. No id,
 * and the stored block is unchanged.
 */
struct db_write_answer db_commander_ask(struct db_commander *commander,
                                        const struct db_request *asked, struct db_write_token token,
                                        db_time now);

/* The same for a write into the command block. */
struct db_write_answer db_commander_write(struct db_commander *commander,
                                          const struct db_client *client,
                                          const struct db_command_write *write,
                                          struct db_write_token token, db_time now);

/* The command staged for the group's start; NONE. */
enum db_command db_commander_staged(const struct db_commander *commander);
/* Carries out the staged command with the stored arguments; there must be one. `group`: see struct
 * db_request. */
struct db_write_answer db_commander_start_staged(struct db_commander *commander,
                                                 const struct db_client *client, uint32_t group,
                                                 struct db_write_token token, db_time now);

/* What may have changed the origin of the drive's position since the commander was made: how many
 * commands, whatever became of them, and the last of these; NONE. */
struct db_origin_changes {
	uint32_t count;
	enum db_command last;
};
struct db_origin_changes db_commander_origin(const struct db_commander *commander);

/* True while a motion is on its way to the drive, or was begun and has not been seen to end: the
 * drive's status may not show it yet. */
bool db_commander_is_to_move(const struct db_commander *commander);

/* When the latest stop of the drive arrived, by whomever; 0: none since the commander was made. */
db_time db_commander_stopped(const struct db_commander *commander);

/* Ticket of the newest command that was submitted; 0: none yet. */
uint32_t db_commander_newest(const struct db_commander *commander);

/* The holder gives a sign of life. False: this client holds nothing, or no longer does. */
bool db_commander_beat(struct db_commander *commander, const struct db_client *client, db_time now);
/* The client sends nothing any more: a motion it holds is stopped with the next
 * db_commander_expire(). */
void db_commander_desert(struct db_commander *commander, const struct db_client *client,
                         db_time now);

/* A write was refused for its form before it reached the commander: for write_result only.
 * `address`: the register for which it was refused; 0: none in particular. */
void db_commander_set_refused(struct db_commander *commander, const struct db_client *client,
                              enum db_result result, uint16_t address);
/* A command, or with NONE a parameter write, was refused before it reached the commander: for the
 * history, too. */
void db_commander_refuse(struct db_commander *commander, const struct db_request *request,
                         enum db_result result, uint16_t address);

/* Ports of set_output that are known to be inputs, bit 0 = port 1: a set_outputs with one of them
 * is refused as a whole. */
unsigned db_commander_input_ports(const struct db_commander *commander);

/* The client addressed this drive: of clients with a record of their own the most silent are
 * forgotten first. */
void db_commander_hear(struct db_commander *commander, const struct db_client *client, db_time now);

/* A client that may write addressed this drive at the time `arrived`, in the way `by`. Not for what
 * the commander itself carries out. */
void db_commander_feed(struct db_commander *commander, const struct db_client *client,
                       enum db_watchdog_feed by, db_time arrived);
/* The client that fed the watchdog last, and may have gone since; DB_CLIENT_NOBODY: none. */
const struct db_client *db_commander_fed_by(const struct db_commander *commander);
void db_commander_set_watchdog(struct db_commander *commander, uint32_t timeout_ms,
                               db_time arrived);
/* The client's connection has ended: its number may be reused. A motion it held is no longer
 * held. */
void db_commander_forget(struct db_commander *commander, const struct db_client *client,
                         db_time now);

/* The stop that would still have to be sent if this program ended now: a pending one, or that of a
 * held motion, which would no longer be held. NONE: there is none. */
enum db_command db_commander_owed_stop(const struct db_commander *commander);
/* No client can hold a motion any more: a held motion is stopped now. */
void db_commander_end_hold(struct db_commander *commander, db_time now);
/* The drive must stand, for a cause of the bridge's own. */
void db_commander_stand(struct db_commander *commander, enum db_command command,
                        enum db_stand_cause cause, db_time now);

/* The bus ended a request; its place is released. */
void db_commander_complete(struct db_commander *commander, struct db_request *request, db_time now);

/* When db_commander_expire() is due; DB_TIME_NEVER. */
db_time db_commander_next_deadline(const struct db_commander *commander);
/* Answers the writers whose time is up (their requests stay pending) and runs the watchdog. True if
 * it tripped now. */
bool db_commander_expire(struct db_commander *commander, db_time now);

/* What the configuration allows, in the drive's own units; NAN: there is no such limit, or the drive has
 * not reported its scale yet. */
struct db_allowed {
	double min_position;
	double max_position;
	double max_velocity; /* the largest target_velocity, in either direction */
};
struct db_allowed db_commander_allowed(const struct db_commander *commander);

/* age 0 is the newest; false: there are fewer entries. */
bool db_commander_history(const struct db_commander *commander, size_t age,
                          struct db_history_entry *entry);

/* Puts an entry of an earlier run before those to come; `args`: of a command. */
void db_commander_recall(struct db_commander *commander, const struct db_history_entry *entry,
                         const struct db_args *args);

/* The result of the command with this number in the history, and of the motion that it began:
 * PENDING while that continues. INDETERMINATE: it is no longer stored. */
enum db_result db_commander_outcome(const struct db_commander *commander, uint32_t entry);

/* The block as shown to this client: the arguments are common to all, the id may be its own. */
struct db_command_block db_commander_kept(struct db_commander *commander,
                                          const struct db_client *client);
void db_commander_state(struct db_commander *commander, const struct db_client *client,
                        struct db_command_state *state, db_time now);

#endif
