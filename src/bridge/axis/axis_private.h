/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The room's own header: everything that a drive's commander is made of. Network thread only, pure
 * where nothing else is said: no clock, no I/O, and no allocation but where a drive is made.
 */
#ifndef DRIVEBRIDGE_AXIS_PRIVATE_H
#define DRIVEBRIDGE_AXIS_PRIVATE_H

#include "drivebridge/axis.h"
#include "drivebridge/client.h"
#include "drivebridge/command.h"
#include "drivebridge/commander.h"
#include "drivebridge/config.h"
#include "drivebridge/result.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/*
 * The last commands and parameter writes of one drive, to find out later what moved it. Pure; in
 * memory only, no allocation.
 */

/* A struct db_history_entry as stored; its place gives its number. */
struct db_history_kept {
	uint64_t timestamp_us;
	uint8_t address[16];
	uint32_t duration_us;
	int32_t position;
	int32_t position_2;
	float real;
	uint32_t value;
	uint16_t port;
	uint16_t command_id;
	uint16_t command;
	uint16_t number;
	uint16_t repeats;
	uint8_t result;
	bool bus; /* it went to the bus */
};

struct db_history {
	uint32_t count; /* entries so far; the newest is number `count` */
	struct db_history_kept entries[DB_HISTORY_MAX];
};

/*
 * Adds an entry and returns its number; `bus`: it goes to the bus, and its end will be added. An
 * identical refusal without the bus, to the same client as the entry before, only increments a
 * count there: so a scanner that writes all the time does not overwrite what happened before.
 */
uint32_t db_history_add(struct db_history *history, const struct db_history_entry *entry, bool bus);

/* The following ignore entries that have been overwritten, and number 0, which none has. */

/* A writer joined the request: no entry of its own. */
void db_history_repeat(struct db_history *history, uint32_t number);

/*
 * What became of a request after so long: called when the bus ended it, and again when the motion
 * that it began ended.
 */
void db_history_end(struct db_history *history, uint32_t number, enum db_result result,
                    db_time took);

/* Adds an entry that is complete, with its repeats; its number is a new one. */
void db_history_recall(struct db_history *history, const struct db_history_entry *entry);

/* age 0 is the newest; false: there are fewer entries. */
bool db_history_get(const struct db_history *history, size_t age, struct db_history_entry *entry);

/* Puts the arguments that a command has into the entry. */
void db_history_args(struct db_history_entry *entry, unsigned code, const struct db_args *args);

/* Limits of the configuration, checked before a command reaches the bus. Pure. */

/* What is known of the drive when a command arrives. */
struct db_limit_facts {
	double counts;          /* drive units per user unit; 0: as configured */
	bool scale_open;        /* the drive is to report that, and has not yet */
	int32_t position;       /* drive units */
	bool has_preset;        /* preset_velocity is known */
	float preset_velocity;  /* the speed of a move without a velocity, as target_velocity */
	double velocity_counts; /* position units a second that target_velocity counts; 0: as 1 */
};

/*
 * The limit that the command would break, or NONE. A move or jog at a preset that is not known
 * breaks a limit of the velocity; while the scale is not known, whatever is limited breaks its
 * limit. A motion without a target (velocity, jog, current) breaks a limit of the position when the
 * drive is beyond it already and would go further; after its beginning db_supervise watches it. The
 * speed that a current leads to is not known.
 */
enum db_limit db_limits_command(const struct db_drive_config *drive, enum db_command command,
                                const struct db_args *args, const struct db_limit_facts *facts);

/* The same for an acceleration, in position units per second squared. */
enum db_limit db_limits_acceleration(const struct db_drive_config *drive, double acceleration,
                                     const struct db_limit_facts *facts);

/* What the configuration allows. */
struct db_allowed db_limits_allowed(const struct db_drive_config *drive,
                                    const struct db_limit_facts *facts);

/*
 * Watches a motion that has no target (a jog, a velocity, a current), so that it does not pass the
 * limits of the position: it is stopped as far before them as its stopping distance may be. For all
 * families. Pure: readings and the time are passed in.
 *
 * The stopping distance is the way until the drive receives the stop, plus the braking distance.
 * The latter is computed where the drive's deceleration is known, and measured whenever it is
 * stopped; the longer of both counts. Where nothing is known yet, and where a drive accelerates
 * between two checks by more than between the two before, it may pass a limit by that much.
 */

struct db_supervise_config {
	double min; /* drive units; NAN: no limit */
	double max;
	double velocity_counts; /* position units per second for a velocity of 1 */
	double deceleration;    /* position units/s^2; 0: not known, INFINITY: it stands at once */
	db_time delay; /* at most, from the time of the data to when the drive receives a stop */
};

struct db_supervise {
	bool active;  /* such a motion continues, or was requested */
	bool stopped; /* it was stopped because of a limit */
	db_time begun;
	db_time since; /* when it was begun, or last seen moving */
	double last_speed;
	db_time last_taken; /* time of the data that contained it */
	bool measuring;     /* it was stopped, and the way is being measured */
	double from;        /* its position then, at this speed */
	double from_speed;
	/* the way of the fastest stop, divided by the square of its speed; s^2/unit */
	double measured;
	double measured_speed;
};

/* True if a command begins a motion that is watched. */
bool db_supervise_applies(enum db_command command);

/* Such a command was submitted; earlier data shows nothing about it. */
void db_supervise_begin(struct db_supervise *supervise, db_time now);

/* Any stop was submitted. */
void db_supervise_stop(struct db_supervise *supervise, const struct db_supervise_config *config,
                       const struct db_feedback *feedback, db_time now);

/* The limit that it would pass if it were not stopped now, returned once each time; or NONE. */
enum db_limit db_supervise_check(struct db_supervise *supervise,
                                 const struct db_supervise_config *config,
                                 const struct db_feedback *feedback, db_time now);

/*
 * Follows a motion that a drive has begun to its end, so that `result` can show it. Pure; `now` is
 * passed in.
 */

struct db_follow_config {
	double window;    /* distance from the target that counts as there, drive units */
	db_time settling; /* how long it must stand there */
	db_time patience; /* a drive that stands elsewhere for this time will not arrive */
	/* a motion that has not shown within this time has not begun, and is not to begin */
	db_time reaction;
};

/* Values of program_state: the same in all families that have programs. */
enum db_program_state {
	DB_PROGRAM_IDLE = 0,
	DB_PROGRAM_RUNNING = 1,
	DB_PROGRAM_WAITING = 2,
	DB_PROGRAM_UNTOLD = UINT16_MAX, /* the drive does not report it */
};

struct db_follow {
	bool active;
	enum db_command command;
	db_time delay;          /* before a program begins */
	uint32_t ticket;        /* of the command that began it */
	db_time since;          /* data must be younger */
	db_time standing_since; /* 0: it moves */
	db_time there_since;    /* 0: it is not at the target */
	bool moved;             /* it was seen moving */
	bool unproven;          /* the drive accepted it, but its beginning did not show */
	bool has_first;
	int32_t first; /* the first position since */
	bool late;     /* homing that has failed: the drive may only be slow to find its origin */
	/* A speed accepted without proof: the value that proves it; 0: nothing to prove. */
	float speed;
	unsigned near;   /* number of the last samples that are near it */
	db_time sampled; /* time of the last sample */
};

/* What a command begins; from MOVE on it has an end of its own. An endless motion is followed too,
 * because it may end unasked. */
enum db_motion {
	DB_MOTION_NONE, /* nothing that is followed */
	DB_MOTION_ENDLESS,
	DB_MOTION_MOVE,
	DB_MOTION_HOME,
	DB_MOTION_SHAKE,
	DB_MOTION_PROGRAM,
};
enum db_motion db_motion_of(enum db_command command);

/* The drive has begun what this request asked for. Not `proven`: it has accepted it, and nothing
 * shows yet that it does; a speed then shows once it differs from the one before. */
void db_follow_begin(struct db_follow *follow, const struct db_request *request, bool proven,
                     db_time now);

/* True once: the effect that was in doubt shows now. */
bool db_follow_shows(struct db_follow *follow, const struct db_feedback *feedback);

/* True once: a homing that was reported as failed has found its origin all the same. */
bool db_follow_is_late(struct db_follow *follow, const struct db_feedback *feedback);

/* PENDING while it continues; else how it ended, and it is no longer followed. */
enum db_result db_follow_check(struct db_follow *follow, const struct db_follow_config *config,
                               const struct db_feedback *feedback, db_time now);

/*
 * A held motion goes on only while somebody holds it: a page's button, a key, an HMI's push button.
 * Its holder gives signs of life (beats); without one for the hold's span, and when its connection
 * ends, the motion is to be stopped at once, whatever the watchdog says. A hold that is over is
 * over: a late beat begins nothing.
 *
 * The clock is looked at before a beat, so that beats which waited while this program did not run
 * do not count.
 *
 * Pure: time is passed in, one thread.
 */

/* Zeroed memory: nothing is held. */
struct db_hold {
	struct db_client holder; /* DB_CLIENT_NOBODY: nothing is held */
	db_time span;            /* how long it lasts without a beat */
	db_time until;
	uint32_t number; /* of the holder's last motion, see struct db_request */
	bool begun;      /* a motion of the hold has begun, or may have */
	bool deserted;   /* the holder's connection has ended */
	bool lost;       /* the latest hold ended because its holder was missed */
	uint16_t beat;   /* the counter of the latest hold, as its holder wrote it last */
};

/* A hold with a counter does not begin at the value at which the latest hold was lost: the counter
 * must have changed since. */
bool db_hold_may_begin(const struct db_hold *hold, const struct db_request *motion);

/* This motion, which arrived then, was submitted. A hold of the same client continues with it;
 * another client's hold becomes this client's. */
void db_hold_begin(struct db_hold *hold, const struct db_request *motion, db_time arrived);

/* The holder gives a sign of life that arrived then. False: this client holds nothing, or no longer
 * does. */
bool db_hold_beat(struct db_hold *hold, const struct db_client *client, db_time arrived,
                  db_time now);

/* The same for a holder with a counter: a sign of life if the value differs from the one before. */
bool db_hold_count(struct db_hold *hold, const struct db_client *client, uint16_t value,
                   db_time arrived, db_time now);

/* This client's connection has ended: its hold is overdue from now on. */
void db_hold_desert(struct db_hold *hold, const struct db_client *client, db_time now);

/* Ends the hold. `lost` stays: a caller that ends it because its holder is missed sets that. */
void db_hold_end(struct db_hold *hold);

/* When the holder is missed; DB_TIME_NEVER while nothing is held. */
db_time db_hold_deadline(const struct db_hold *hold);

/*
 * Stops a drive on silence: notices that no client that may command the drive communicates any
 * more. Armed by the first motion command, fed by requests, by writes that were admitted or by a
 * heartbeat; when it expires it latches until it is reset. Pure: time is passed in, one thread.
 *
 * The times passed in are the arrival times of requests, which may be long before they are served:
 * an old request shows nothing about the present, and never undoes a later one.
 *
 * A client commands the drive if it has commanded it since the watchdog was armed. For reads the
 * connection counts, not the address: a monitor may run on the same machine as the PLC. A write
 * also counts from another connection of its address: a PLC that reconnects and repeats its
 * command.
 *
 * With DB_FEED_HEARTBEAT nothing that an I/O scanner repeats by itself keeps a drive moving after
 * the program of its PLC has died: neither the same motion command again nor the same settings.
 */

/* Number of connections remembered as commanding the drive; the oldest is replaced. */
#define DB_WATCHDOG_COMMANDERS 4

struct db_watchdog_commander {
	uint32_t client; /* DB_CLIENT_NOBODY: its connection has ended */
	bool taken;
	uint8_t address[16];
};

struct db_watchdog {
	uint32_t timeout_ms; /* 0 = off */
	enum db_watchdog_feed feed;
	bool armed; /* false: nothing to watch until the next motion command */
	bool latched;
	db_time latched_at;
	bool was_commanded_by_plc; /* since it was armed; also the next field */
	bool session_has_left;
	db_time fed;
	uint32_t trips; /* since the start */
	struct db_watchdog_commander commanders[DB_WATCHDOG_COMMANDERS];
	unsigned next_commander; /* the next place to be used */
};

void db_watchdog_init(struct db_watchdog *watchdog, uint32_t timeout_ms,
                      enum db_watchdog_feed feed);

/* 0 turns it off, which does not undo a latch. A new time counts from now; setting the same time
 * changes nothing. */
void db_watchdog_set(struct db_watchdog *watchdog, uint32_t timeout_ms, db_time now);

/* A motion command was accepted. */
void db_watchdog_arm(struct db_watchdog *watchdog, db_time now);

/* This client has commanded the drive, other than by a stop. May be DB_CLIENT_NOBODY. */
void db_watchdog_commanded(struct db_watchdog *watchdog, const struct db_client *client);
/* True if this client has since it was armed, over this connection or another one of its address;
 * null: any client. */
bool db_watchdog_is_commanded_by(const struct db_watchdog *watchdog,
                                 const struct db_client *client);
/* The client's connection has ended. */
void db_watchdog_forget(struct db_watchdog *watchdog, uint32_t client);

/*
 * A client that may write addressed the drive: `by` a request of any kind (REQUESTS), an admitted
 * write, or a heartbeat that has changed. A write of a client that does not command the drive
 * counts as a request, and a heartbeat counts as a write where no heartbeat is required. Returns
 * whether that was enough to feed it.
 */
bool db_watchdog_feed(struct db_watchdog *watchdog, enum db_watchdog_feed by,
                      const struct db_client *client, db_time now);

/*
 * True if only sessions of the control socket have commanded the drive since it was armed, and they
 * have ended: their commands are done, and if the drive stands, nothing is lost. A PLC that
 * disconnects is lost in any case.
 */
bool db_watchdog_is_deserted(const struct db_watchdog *watchdog);

/* When it will expire; DB_TIME_NEVER while it is off, not armed or latched. */
db_time db_watchdog_deadline(const struct db_watchdog *watchdog);

/* True once when the time is up: latches and disarms. */
bool db_watchdog_trip(struct db_watchdog *watchdog, db_time now);

/* Ends the latch; the next motion command arms it again. */
void db_watchdog_reset(struct db_watchdog *watchdog);

/* Milliseconds left; 0 while it is off, not armed or latched. */
uint32_t db_watchdog_remaining_ms(const struct db_watchdog *watchdog, db_time now);

/*
 * What one drive remembers of the clients that command it: which command ids were used, and what
 * became of their commands. One record for all clients, or one for each client address; then for
 * the latest addresses, and the one that was silent longest is forgotten. A forgotten client is new
 * again: its next id is only a start value, so forgetting executes nothing. In addition the result
 * of the latest command of any client. Pure: one thread, no clock.
 */

/* Number of addresses remembered. */
#define DB_WRITERS 8

/* A command id that was used, and what became of it. */
struct db_used_id {
	uint32_t ticket;
	uint16_t id; /* 0: a command without */
	enum db_result result : 8;
	bool sent : 1; /* it went to the bus */
};

/* Results of a writer's commands and of the motion that they began. */
struct db_outcome {
	struct db_command_results results;
	bool motion_ends; /* the motion has an end of its own */
	/* another motion was requested since and did not begin: `done` is not about it */
	bool motion_refused;
	uint32_t refused_number; /* with motion_refused: see db_writers_refuse_motion() */
	bool motion_last;        /* its motion is the one that ended last */
	uint32_t ticket;         /* the command that `result` is about */
	uint32_t write_ticket;   /* the request that `write_result` is about */
};

struct db_writer {
	db_time heard;
	uint8_t address[16];
	uint16_t kept_id; /* the command_id that the writer wrote last */
	bool taken;
	struct db_used_id last;     /* id 0: no id was seen yet */
	struct db_used_id previous; /* restored when the bus refuses `last` as busy */
	bool has_executed;          /* the following hold something */
	uint16_t executed_command;  /* its newest command of the block that was executed */
	struct db_args executed_args;
	struct db_used_id execution; /* the result of that */
	bool commanded;              /* `own` holds something */
	struct db_outcome own;       /* of its own commands */
};

struct db_writers {
	bool by_address;
	struct db_outcome latest; /* of the latest command of any writer */
	struct db_writer all;     /* for all clients */
	/* DB_WRITERS of them, while records are by address; null: no memory for that */
	struct db_writer *each;
};

/* Forgets the writers; zeroed memory means one record for all. Memory for records by address must
 * be there before, and is released when there is one record for all. */
void db_writers_set(struct db_writers *writers, bool by_address);

/* Null when this client has commanded nothing that is remembered. Without by_address there is one
 * record for all, also for no client (null). */
struct db_writer *db_writers_find(struct db_writers *writers, const struct db_client *client);
/* The same, but creates the record; null only for no client. */
struct db_writer *db_writers_claim(struct db_writers *writers, const struct db_client *client,
                                   db_time now);

/* Another request took the place of this one: what was remembered for it now refers to that
 * request. 0: its ticket is reused, and the former meaning is over. */
void db_writers_retarget(struct db_writers *writers, uint32_t ticket, uint32_t to);

/*
 * The following are about the latest command of all and, where `writer` is not null, about its own.
 * `ticket` is its request; 0: none.
 */

/* The result of a write, and the register for which it was refused; 0: none. */
void db_writers_set_write(struct db_writers *writers, struct db_writer *writer,
                          enum db_result result, uint16_t refused_register, uint32_t ticket);
/* The same for a command; an id is used up by it, unless it was refused as busy. */
void db_writers_set_command(struct db_writers *writers, struct db_writer *writer,
                            const struct db_request *request, enum db_result result,
                            uint32_t ticket);
void db_writers_set_limit(struct db_writers *writers, struct db_writer *writer,
                          enum db_limit limit);
/* It went to the bus, or ended without it: if it came by the command block, a bare repetition is
 * compared with it. */
void db_writer_set_executed(struct db_writer *writer, const struct db_request *request,
                            enum db_result result, uint32_t ticket);

/* A request ended. */
void db_writers_complete(struct db_writers *writers, uint32_t ticket, enum db_result result,
                         uint32_t took_us);

/* Another motion was requested: `done` and `aborted` refer to it from now on. */
void db_writers_ask_motion(struct db_writers *writers, struct db_writer *writer);
/* The same by joining a pending stop: only the writer's own outcome is new. */
void db_outcome_ask_motion(struct db_outcome *outcome);
/* The motion that was requested did not begin; `number`: of its request, or where it was none, the
 * one that the next request will have. */
void db_writers_refuse_motion(struct db_writers *writers, struct db_writer *writer,
                              uint32_t number);
/* The drive has begun a motion; `cancelled`: another command had overtaken it by then. */
void db_writers_begin_motion(struct db_writers *writers, struct db_writer *writer,
                             const struct db_request *request, bool ends, bool cancelled);

/* The current motion is ended by another command; the writer that began it is notified. */
void db_writers_cancel_motion(struct db_writers *writers);
/* The current motion has ended by itself; `ticket` is its command's. `corrected`: the motion that
 * ended last, with none begun since, has in fact ended in this way. */
void db_writers_end_motion(struct db_writers *writers, uint32_t ticket, enum db_result result,
                           bool corrected);

/*
 * Parameter writes that a drive has acknowledged and that nothing has proved: they are settled by
 * the values of these parameters that the drive reports later. Network thread only; allocates only
 * where a drive is made.
 */

/* Number of parameters remembered for a drive; if there are more, the oldest stay unproven. */
#define DB_SETTLE_MAX 8

/* One parameter of such a write. */
struct db_unsettled {
	uint32_t ticket; /* of the write; 0: a free place */
	struct db_noted noted;
	db_time arrived;
	/* what the drive reports after this settles it; DB_TIME_NEVER: the write has not ended
	 * yet */
	db_time since;
	uint16_t param;
	union db_value written;
};

struct db_settle {
	struct db_unsettled *places; /* null: the family proves each write at once */
	size_t count;                /* of these */
	size_t next;                 /* the place that is used next */
	db_time check_at; /* the next check; DB_TIME_NEVER: there is nothing to be settled */
};

/* A write was submitted. The result of an older write to the same parameters can no longer be
 * determined. */
void db_settle_submitted(struct db_commander *commander, const struct db_request *request);
/* The write has ended. */
void db_settle_ended(struct db_commander *commander, const struct db_request *request, db_time end);

/* Checks whether the drive has reported the awaited values, if it is time. */
void db_settle_check(struct db_commander *commander, db_time now);

/* Delay before a stop that found no room at the bus is submitted again. */
#define DB_STOP_RETRY (5 * DB_NS_PER_MS)

struct db_commander {
	struct db_commander_config config;
	const struct db_commander_ops *ops;
	void *context;

	struct db_command_block kept; /* as written last */
	struct db_writers writers;
	struct db_history history;

	/* Requests. */
	struct db_request *pending; /* newest first */
	uint32_t newest;            /* ticket of the latest command or write */
	uint32_t submitted;         /* requests so far */
	unsigned waiting;           /* waiters of all requests */
	struct db_origin_changes origin;
	db_time stopped; /* arrival of the latest stop; motions that arrived before it are over */

	struct db_settle settle; /* parameter writes without proof */

	/* Motions. */
	struct db_follow follow; /* the motion that the drive has begun last, if it is followed */
	struct db_noted follow_noted;
	db_time follow_arrived;
	struct db_supervise supervise; /* the motion without an end */
	db_time check_at;              /* time of the next check of it */
	db_time check_interval;

	/* Clients that are missed. */
	struct db_watchdog watchdog;
	struct db_client fed_by; /* the client that fed it last; DB_CLIENT_NOBODY: none */
	struct db_hold hold;
	/* The stop for them: the same for every cause, so that none weakens what another has asked
	 * for. Without on-client-loss there is no watchdog; a held motion is stopped all the same.
	 */
	enum db_command reaction;
	enum db_stand_cause reaction_cause; /* of that stop */
	/* it found no room and is submitted again then; or NEVER */
	db_time reaction_again_at;
	/* next look for a drive that moves although no client has commanded it since the start;
	 * NEVER: the drive has been seen */
	db_time find_at;
};

/* --- outcome: what became of requests --------------------------------------------------------- */

/* Adds a request to the history and the audit trail: with `pending` one that went to the bus, whose
 * end will be added. In the history, of several settings the first is recorded. */
void db_outcome_record(struct db_commander *commander, const struct db_request *request,
                       enum db_result result, struct db_request *pending);
/* How it ended after so long, or how it ended after all. */
void db_outcome_end(struct db_commander *commander, struct db_noted noted, enum db_result result,
                    db_time took);
/* A request is served by a pending stop. */
void db_outcome_join(struct db_commander *commander, const struct db_request *request,
                     const struct db_request *stop);

/* Logs a write that did not achieve what its writer wanted; a successful one is not logged. */
void db_outcome_log(const struct db_commander *commander, const struct db_client *client,
                    const struct db_refused_write *write);

/* --- flight: the requests that the bus has ---------------------------------------------------- */

/* OK when the drive can be asked now. A stop is kept for a drive, or a bus, that may come back. */
enum db_result db_flight_reach(const struct db_commander *commander, enum db_command command);

/* Null if no pending request has this ticket. */
struct db_request *db_flight_find(const struct db_commander *commander, uint32_t ticket);

/* Kinds of pending requests. */
enum db_pending {
	DB_PENDING_SETTINGS,    /* a parameter write: the drive's parameters may still change */
	DB_PENDING_MOTION,      /* a command that replaces the motion */
	DB_PENDING_HELD_MOTION, /* a motion that its client holds */
	DB_PENDING_STOP_AGAIN,  /* a stop that is submitted again when it ends: nothing may be sent
	                         * before that */
};
/* True if such a request is pending, other than `but` (which may be null). */
bool db_flight_has(const struct db_commander *commander, enum db_pending kind,
                   const struct db_request *but);

/* Hands the request to the bus and fills in its ticket and drive. Returns the pending one; null
 * when the drive's or the bus's queue is full. */
struct db_request *db_flight_submit(struct db_commander *commander, struct db_request *request);

/* A client's stop was submitted: writers that wait for an older one of its kind, or would be
 * notified of it, wait for this one. */
void db_flight_replace_stop(struct db_commander *commander, struct db_request *stop);

/*
 * The pending stop that a stop of this kind may join: the drive's newest command, or one that is
 * then submitted again. An older one must not be joined as it is, because what was queued after it
 * would run after both: where there is no place for another of its kind, it will be repeated. Null:
 * there is none.
 */
struct db_request *db_flight_join_stop(struct db_commander *commander, enum db_command command);

/* When this stop ends, another one is submitted in its place. */
void db_flight_stop_again(struct db_request *stop, enum db_command command,
                          enum db_stand_cause cause);
/* The stop has ended, and is submitted again in its place. */
void db_flight_repeat_stop(struct db_commander *commander, struct db_request *stop, db_time now);

/* The writer waits for the request's end, unless it is not to wait or there is no room. */
struct db_write_answer db_flight_wait(struct db_commander *commander, struct db_request *request,
                                      struct db_write_token token, db_time now);
/* The request has ended: its place is free, and its waiters are answered. */
void db_flight_end(struct db_commander *commander, struct db_request *request);
/* Answers waiters whose time is up. */
void db_flight_expire(struct db_commander *commander, db_time now);
/* When that is due; DB_TIME_NEVER. */
db_time db_flight_deadline(const struct db_commander *commander);

/* --- motion: followed to its end, and kept within the limits ---------------------------------- */

/*
 * A request was submitted, by this writer or (null) none: a stop ends what moves and what is still
 * to begin, in any case. Another motion does so only when the drive accepts it: until then it is
 * undecided.
 */
void db_motion_submitted(struct db_commander *commander, struct db_writer *writer,
                         enum db_command command, db_time now);
/* The request has ended. */
void db_motion_ended(struct db_commander *commander, const struct db_request *request, db_time now);
/* A stop arrived then: no motion that arrived before it begins any more. */
void db_motion_stopped(struct db_commander *commander, db_time arrived);

/* Submits a stop of the bridge itself; null: there is no room. It is recorded by the second one. */
struct db_request *db_motion_submit_stop(struct db_commander *commander, enum db_command command,
                                         enum db_stand_cause cause, db_time now);
void db_motion_record_stop(struct db_commander *commander, struct db_request *stop,
                           enum db_command command, db_time now);

/* A motion without an end continues, or is requested, and is to be kept within the limits. */
void db_motion_supervise(struct db_commander *commander, enum db_command command, db_time now);

/* Checks the current motion, if it is time. */
void db_motion_check(struct db_commander *commander, db_time now);
/* When the next check is due; DB_TIME_NEVER. */
db_time db_motion_deadline(const struct db_commander *commander);
/* Interval at which a motion on this bus is checked. */
db_time db_motion_check_interval(const struct db_bus_config *bus);

/*
 * --- guard: the stop when clients are missed -----------------------------------------------------
 *
 * By the watchdog when all of them fall silent, with the latch after it, and by the end of a hold
 * when the holder of a motion is gone. The bus repeats the stop until the drive stands.
 */

/* Does what is due: the stop, again if necessary, and the first check of a drive. True if the
 * watchdog tripped now. */
bool db_guard_run(struct db_commander *commander, db_time now);
/* The part of it that ends a hold: called before a later request of the holder is handled. */
void db_guard_check_hold(struct db_commander *commander, db_time now);

/* Ends the latch. A drive that still moves is watched again. */
void db_guard_unlatch(struct db_commander *commander, db_time now);

#endif
