/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parts of the engine and what they share. A node is one address on the bus, which answers or
 * does not; a station is one drive there. Nearly always a node has one station; a controller with
 * several axes is one node with a station for each. Bus thread only; private to src/bridge/sched.
 *
 * What each file does is the title of its section below. engine.h has what the bus's thread calls;
 * what can be tested without an engine has headers of its own: standing.h, learn.h, doubled.h,
 * visit.h, queue.h.
 */
#ifndef DRIVEBRIDGE_SCHED_PRIVATE_H
#define DRIVEBRIDGE_SCHED_PRIVATE_H

#include "codec/can.h"
#include "drivebridge/bus.h"
#include "drivebridge/driver.h"
#include "drivebridge/shares.h"
#include "drivebridge/trouble.h"
#include "sched/doubled.h"
#include "sched/engine.h"
#include "sched/learn.h"
#include "sched/queue.h"
#include "sched/standing.h"

/* --- shares.c: which class sends next -------------------------------------------------------- */

/*
 * Each class gets its part of the wire (drivebridge/shares.h). A class that has nothing to send
 * leaves its time to the others and cannot claim it later; a class that has just got something to
 * send and is not in debt goes before those after it in the list. Pure.
 */
struct shares {
	unsigned waiting; /* one bit per class: had something to send at the last choice */
	db_time owed[DB_SHARE_COUNT]; /* wire time; below 0: the class has had more than its part */
};

/* Which of these classes (bits, not 0) sends next. */
enum db_share shares_choose(struct shares *shares, unsigned waiting);
/* This class has used the wire for `cost`. NONE: charged to no class. */
void shares_charge(struct shares *shares, enum db_share share, db_time cost);

/* --- nodes and stations ---------------------------------------------------------------------- */

/* A conversation with a drive. Conversations of different lanes may interleave, exchange by
 * exchange. The first station of a node carries out polls and probes for all its stations. */
enum lane_kind { LANE_STOP, LANE_POLL, LANE_IDENTIFY, LANE_PROBE, LANE_COMMAND, LANE_COUNT };

struct lane {
	bool active;    /* begun, not ended */
	bool ready;     /* its next exchange is prepared and waits to be sent */
	bool sent;      /* a frame of the job was sent */
	unsigned tries; /* number of repeats of the prepared exchange */
	struct db_job job;
	struct db_exchange exchange;
};

/* A request that waits for a stop of the drive. */
struct stop_waiter {
	struct db_request *request;
	enum db_command command;
};

struct station;

/* An exchange on the wire. */
struct flight {
	struct station *station; /* null: nothing is under way */
	enum lane_kind lane;
	enum db_share share; /* the class that is charged */
	bool in_step;        /* the node was: an answer proves something */
	bool got_unusable;   /* a frame that is no answer was received from there */
	bool extended;       /* its answer had begun when it was overdue: it is awaited */
	uint32_t question;   /* its number in the trace */
	db_time sent;
	db_time wire; /* the time on the wire of that, without the drive's response time */
	db_time deadline;
	db_time patience; /* the response time included in it */
	db_time pause;    /* on a serial line: time since the last reply of any drive */
};

struct node {
	unsigned address;
	unsigned losses;         /* consecutive lost exchanges */
	struct node *next_spare; /* the next spare node, freed together with this one */
	struct station *first;   /* the others follow, linked by next_axis */
	/* the first drive's device; polls for all, and stays when that drive is removed */
	struct db_device *head;
	struct flight flight; /* one exchange at a time */

	bool online;
	bool in_step;
	unsigned free_probes; /* number of probes that need not wait for the share of probes */
	bool poll_due;
	bool unread;         /* not read yet in this round over all drives */
	enum db_share share; /* MOVING or STANDING: the class in which it is read */

	/*
	 * Answers that may still arrive. Drives answer in the order of the requests, so the answer
	 * to a probe shows that nothing older is on its way, provided it is the answer to *that*
	 * probe: while a lost status or command may still be answered, an answer is first taken for
	 * that of an earlier lost probe.
	 */
	db_time late_answer_time; /* how late an answer can be */
	db_time risky_until;    /* a lost exchange other than a probe may be answered until then */
	unsigned late_probes;   /* number of lost probes that may be answered */
	uint32_t lost_question; /* the exchange lost last */
	db_time late_probes_until; /* after that, none will be answered */

	/* What is learnt about its times. */
	struct learn_gap gap; /* from its reply to the next request to itself */
	/* from its reply to a request to another drive: it may still drive the line */
	struct learn_gap hold;
	struct learn_patience patience;
	db_time lost_due; /* when the answer to the exchange lost last should have begun; 0: none */
	db_time answered_at; /* when it answered last; 0: never */
	db_time received_at; /* when anything was received from it last */
	db_time test_gap_at; /* its gap is not tested before this time */

	/* Wire time of the last poll on CAN: the next one is nearly always the same, and comparing
	 * is faster than counting a frame's stuff bits again. */
	struct db_can_frame poll_frame;
	size_t poll_answer; /* as answer_length */
	db_time poll_wire;  /* 0: not known */

	db_time used;      /* wire time used in its class; the node with the least is read next */
	db_time spent;     /* wire time of the poll that is under way */
	db_time poll_cost; /* average wire time of a poll; 0: unknown */
	/* interval at which it is read, for the drives that moved as the cycle began */
	db_time interval;
	db_time poll_duration; /* average time from the first request of a poll to its last answer
	                        */

	struct db_unusable unusable; /* received from its address since its last valid status */
	/* LATE or DEAF: a cause of its losses that longer waiting does not cure, until it is
	 * online */
	enum db_trouble_cause timing;
	unsigned late_ms; /* how late its last answer was after its time-out */
	struct doubled doubled;

	db_time probe_at;
	db_time probe_backoff;
};

/* What was logged about a drive last, so that only changes are logged. */
struct last_logged {
	bool online;
	bool missing;     /* it was logged that the drive does not answer */
	bool unusable;    /* it was logged what was received instead of an answer */
	uint16_t silence; /* enum db_trouble_cause: why it does not answer, as known last */
	db_time silent;   /* since when; 0: it never answered */
	uint16_t error;
	uint32_t status;
	uint32_t restarts;
	uint32_t doubts;
};

struct station {
	uint16_t number;     /* as requests name it */
	bool leaving;        /* to be removed as soon as possible */
	bool stops_others;   /* its controller's stop is for all axes, see standing_owe() */
	bool stop_follows;   /* a stop has ended, and the network thread posts the next one */
	bool starts_alone;   /* its command no longer waits for a common start */
	unsigned stop_count; /* of `stops` */
	struct node *node;
	struct node *spare;        /* used if it is the first drive at its address; freed with it */
	struct station *next_axis; /* at the same address */
	const struct db_drive_config *config;
	struct db_axis *axis;
	struct db_device *device; /* null once its node keeps it as its head */
	struct db_snapshot snapshot;
	struct last_logged last_logged;
	struct lane lanes[LANE_COUNT];
	uint8_t requests[LANE_COUNT - 1]
			[DB_SHORT_REQUEST]; /* LANE_COMMAND uses its request's buffer */

	uint32_t generation; /* of the nameplate published last */
	uint32_t tellings;   /* as in the nameplate published last */
	bool plate_published;
	bool command_cancelled;
	bool blind_stop_sent; /* a stop was sent while out of step; its answer proves nothing */
	db_time identify_at;  /* not before: the last attempt failed */
	db_time identify_backoff;

	struct db_request *request;
	db_time commanded;     /* when the last command for it arrived */
	db_time command_ended; /* when its last command ended */
	/* when its command last repeated a question whose answer does not show its effect yet */
	db_time again_sent;

	struct standing standing;
	struct stop_waiter stops[DB_QUEUE_STOPS_EACH];
	db_time motion_sent; /* when the last motion command was sent */

	uint64_t round_trips;
	uint64_t round_trip_sum_us; /* of those */

	/* as in the nameplate: the missing parameters that were logged last */
	uint64_t missing[];
};

/* No drive answers later than this multiple of the configured latency: a request that was not
 * answered by then never will be. */
#define LATE_ANSWER_LATENCIES 4

/* Interval of probes to an offline drive: at first, and at most. */
#define PROBE_BACKOFF_MIN (100 * DB_NS_PER_MS)
#define PROBE_BACKOFF_MAX (2 * DB_NS_PER_S)

/* Pause before a drive that did not report its parameters is asked again, at first and at most. */
#define IDENTIFY_BACKOFF_MIN (500 * DB_NS_PER_MS)
#define IDENTIFY_BACKOFF_MAX (30 * DB_NS_PER_S)

/* --- the engine ------------------------------------------------------------------------------ */

#define RECEIVE_MAX (DB_ANSWER_MAX + 512) /* an answer, and garbage before it */

struct scan;

/* The line is reserved for an exchange that has to wait a little. Stops go first. */
struct reserved {
	struct station *station; /* null: for no station, or for a frame to all */
	enum lane_kind lane;
	enum db_share share; /* the class that is charged */
	db_time since;
	db_time until; /* 0: not reserved */
};

struct db_engine {
	const struct db_bus_config *bus;
	const struct db_driver *driver;
	struct db_queue *queue;
	const struct db_engine_ops *ops;
	void *context;
	int64_t wall_offset_us;
	struct db_trace *trace;
	struct db_bus_stats stats;
	db_time now; /* time of the current call from outside */

	/* Nothing is to be done before this time, unless something has happened since: then it is
	 * 0. */
	db_time idle_until;
	/* Lets most turns avoid looking at every drive. */
	bool drives_active;   /* a drive may have a command or a stop under way, or must stand */
	size_t nodes_due;     /* number of nodes to be read */
	db_time run_by;       /* the latest time at which it asked to be run again; 0: none */
	db_time overslept_at; /* when it was last run later than that: the computer was busy */

	unsigned flights;        /* number of exchanges under way */
	db_time overdue_from;    /* none of them is overdue before this time */
	unsigned exchange_count; /* exchanges begun so far: the number of the latest one */
	/* when the wire would have carried them all if drives responded at once */
	db_time wire_free;
	db_time port_full_since; /* the port cannot take more; 0 = it can */

	db_time late_until; /* an exchange that timed out may still be answered until then */
	size_t awaited;     /* maximum length in bytes of the answer to the last request */
	/* nothing is sent until then: a broadcast is on the wire, or drives switch from sending to
	 * receiving */
	db_time quiet_until;
	/* On a serial line: the node that answered last (null: none yet), when, and whether it is
	 * asked again at once, to see that it can receive. */
	struct node *last_to_answer;
	db_time last_answer_at;
	bool tests_gap;
	struct reserved reserved;
	/* The bus's own messages: when each is due (DB_TIME_NEVER: not any more), the first of
	 * these times, and how many were sent since the port was opened. */
	db_time message_at[DB_BUS_MESSAGES_MAX];
	db_time next_message_at;
	uint32_t messages_sent[DB_BUS_MESSAGES_MAX];
	/* An address without a drive that answered a scan (0: none), and when. */
	unsigned foreign_address;
	db_time foreign_received_at;
	uint8_t received[RECEIVE_MAX];
	size_t received_length;
	const struct db_exchange *asked; /* the latest; its answer is awaited while it is flying */
	db_time frame_silence;           /* the family's; 0: none */
	/* when that has passed after the bytes in `received`; 0: it has, or there are none */
	db_time silent_at;

	struct db_request **waiting; /* taken, not begun; in order of arrival */
	size_t waiting_count;
	size_t waiting_max;

	db_time period;
	db_time cycle_at; /* when the next cycle is due; 0 before the first */
	db_time round_started;
	size_t unread;     /* number of drives not read yet in this round */
	db_time poll_time; /* time for polling one node, and for each further drive there */
	db_time axis_time;
	db_time identify_checked_at; /* when `may_identify` was determined last */
	bool may_identify;       /* a drive may want to be asked for its identity or parameters */
	bool round_overran;      /* the last round took longer than a cycle */
	bool last_was_continued; /* the last exchange of a command was not its first */

	struct shares shares;
	/* the last exchange of the class of moving drives repeated a command's question */
	bool repeat_was_last;
	enum db_share charged_class;    /* the class that is charged for what is sent now */
	db_time served[DB_SHARE_COUNT]; /* MOVING, STANDING: `used` of the node read last */
	size_t members[DB_SHARE_COUNT]; /* MOVING, STANDING: number of drives, ... */
	db_time demand[DB_SHARE_COUNT]; /* ... and what reading each of them once takes */

	db_time probes_from; /* the share for offline drives is used up until then */
	/* the share for stops to drives that are offline is used up until then */
	db_time stops_from;
	bool stop_was_last; /* the last exchange that began was of a stop */
	db_time busy;       /* time with an exchange on the wire in the current second */
	db_time second_at;

	bool shutting_down;
	size_t next_poll; /* next index of the round robin */
	size_t next_command;
	size_t next_stop;
	size_t next_identify;
	size_t next_refresh;
	db_time refresh_at; /* the parameters of a drive are read again, not before this time */
	size_t next_probe;
	struct node **nodes; /* in the order in which their first drives were added */
	size_t node_count;
	struct station **stations; /* in the order in which they were added */
	size_t station_count;
	struct db_change *change;  /* in progress */
	struct db_change *changed; /* carried out, not fetched */
	struct scan *scan;         /* in progress, see scan.h; null: none */
};

static inline bool is_flying(const struct node *node)
{
	return node->flight.station != NULL;
}

/* --- node.c: what answers at one address ----------------------------------------------------- */

/* A node without stations. Null when out of memory. */
struct node *node_new(const struct db_bus_config *bus, unsigned address);
/* Also frees its head; not its stations. */
void node_free(struct node *node);

/* An exchange was not answered; `probe`: it was a probe. */
void node_expect_late_answer(struct node *node, bool probe, db_time now);
/* A new node takes the place of `from` at its address: answers to the old one may still arrive. */
void node_inherit_late_answers(struct node *node, const struct node *from);
/* Until this time a probe is of no use, because its answer could not be distinguished from a late
 * answer. */
db_time node_late_answers_until(const struct node *node, db_time now);
/* True if it must be probed first, and the answer could not be distinguished from an earlier
 * probe's yet. */
bool node_waits_out_late_answers(const struct node *node, db_time now);
/* True if the answer just received to a probe may be an earlier probe's. */
bool node_is_late_answer(struct node *node, db_time now);

/* True if one of its drives moves, must stand, has something to do, or was commanded within
 * DB_SHARE_LIVELY_MS. */
static inline bool node_is_lively(const struct node *node, db_time now)
{
	const db_time after = DB_SHARE_LIVELY_MS * DB_NS_PER_MS;

	for (const struct station *s = node->first; s; s = s->next_axis) {
		if (s->snapshot.feedback.status & DB_STATUS_MOVING ||
		    !standing_is_free(&s->standing))
			return true;
		if (s->commanded != 0 &&
		    (s->request || now - s->commanded < after || now - s->command_ended < after))
			return true;
	}
	return false;
}

/* The current poll has ended, answered or not. */
void node_end_poll(struct node *node, bool answered, db_time now);

/* When it can receive the next request, as far as known. In the past: now. */
static inline db_time node_may_be_asked_at(const struct node *node)
{
	return node->answered_at == 0 ? 0 : node->answered_at + node->gap.now;
}

/* The current exchange was answered. `in_time`: the answer was read when it arrived, so that its
 * time is the drive's. */
void node_answered(struct node *node, bool in_time, db_time now);
/* The latency of an unexpected frame, taken as the answer to the exchange lost last; 0: it is
 * none. */
db_time node_latency_of_late_answer(const struct node *node, db_time now);

/* --- station.c: one drive, its stops and its command ----------------------------------------- */

/* Has a spare node, and is at no node yet. Null when out of memory. Any thread. */
struct station *station_new(const struct db_bus_config *bus, const struct db_bus_drive *drive);
void station_free(struct station *station);

/* Adds the station to the node. */
void station_join(struct station *station, struct node *node, const struct db_bus_config *bus);
/* The opposite; a node without stations becomes the station's spare node. True then. */
bool station_part(struct station *station, const struct db_driver *driver);

/* The conversation of a lane's job, with the device that does this kind of job. */
struct db_conversation station_conversation(struct station *station, enum lane_kind kind,
                                            db_time now);

/* Publishes what the driver knows to the other threads. */
struct bus_state {
	bool up;
	bool aside; /* out of service for a scan */
	int64_t wall_offset_us;
	db_time interval; /* interval at which the drive is read now */
	db_time now;
};
void station_publish(struct station *station, const struct db_driver *driver,
                     const struct bus_state *bus);

/* `in_time` as in node_answered(): if false, the time does not count. */
void station_count_answer(struct station *station, db_time round_trip, bool in_time);

/* The drive must stand from now on; the request that waits for it may be null. The caller handles
 * what is queued or running for the drive. */
void station_add_stop(struct station *station, enum db_command command, enum db_stand_cause cause,
                      struct db_request *request, db_time now);
/* A stop was sent; the requests that wait for one are notified. */
void station_stop_sent(struct station *station, bool trusted, db_time now);
/* Ends the waiting stops: those of this command, or with DB_CMD_NONE all but a disable, which ends
 * when the power is known to be off. */
void station_finish_stops(struct station *station, enum db_command command, enum db_result result,
                          db_time now);
/* True if it was read since its last command ended, and nothing is being sent that could start a
 * motion. */
bool station_is_read(const struct station *station);
/* True if, in addition, it stood. */
bool station_is_seen_to_stand(const struct station *station);

/* True if a request waits for a stop, or no effect of it was seen yet. */
bool station_has_open_stop(const struct station *station);
/* True if nothing else may be sent to the drive before its stop had an effect, or was seen to have
 * none. */
bool station_awaits_stop(const struct station *station);
/* Its rules: how long it may take to obey, and so on. */
struct standing_rules station_rules(const struct station *station, const struct db_driver *driver,
                                    db_time now);

/* Ends the waiting stops, whether or not they were sent. */
void station_drop_stops(struct station *station, db_time now);

/* Ends the current command or parameter write, if there is one. */
void station_finish_command(struct station *station, enum db_result result, db_time now);
/* The current parameter write is abandoned: the driver reports which parts the drive has
 * acknowledged, and the rest ends with the result given by the caller. */
void station_settle_write(struct station *station, const struct db_driver *driver, db_time now);
/* A stop or the shutdown overtakes the command: ends it, or lets it end as cancelled when it is on
 * the wire. */
void station_cancel_command(struct station *station, const struct db_driver *driver, db_time now);

/* Ends the current command of a drive that is lost: the driver reports what is known of its
 * fate. */
void station_abandon_command(struct station *station, const struct db_driver *driver,
                             enum db_result unless_known, db_time now);

/* --- report.c: publishing drives, and logging what has changed ------------------------------- */

/* Publishes what the driver knows, and reports what has changed. */
void engine_publish(struct db_engine *engine, struct station *station);
/* The station is released: reports it if its on_exit is still unconfirmed. */
void engine_report_unconfirmed(struct db_engine *engine, const struct station *station);
/* Reports an event of the drive, together with what is shown of it. */
void engine_report_event(struct db_engine *engine, const struct station *station,
                         enum db_event event);
/* Reports that a drive does not keep to the times of the configuration. */
void engine_report_timing(struct db_engine *engine, struct station *station,
                          const struct db_engine_timing *timing);
/* Reports that a drive does not answer, once until it answers again. */
void engine_report_missing(struct db_engine *engine, struct station *station);
/* Reports what was received from it that is no answer, if anything; once while it does not
 * answer. */
void engine_report_unusable(struct db_engine *engine, struct station *station);
/* Reports a raw frame if the current command is one; see on_raw_frame. */
void engine_report_raw_frame(struct db_engine *engine, const struct station *station, bool sent,
                             const uint8_t *bytes, size_t length);

/* --- drives.c: drives online and offline, and the requests that wait for them ---------------- */

/* The drive of this number, or null. */
struct station *engine_find_station(const struct db_engine *engine, uint16_t number);
/* The node at this address, or null. */
struct node *engine_find_node(const struct db_engine *engine, unsigned address);

/* A node has answered, or does not answer any more; its drives' commands end with `result`. */
void engine_bring_online(struct db_engine *engine, struct node *node, db_time now);
void engine_take_offline(struct db_engine *engine, struct node *node, enum db_result result,
                         db_time now);
/* The drive is online, as one of a node that answers. */
void engine_count_online(struct db_engine *engine, struct station *station, db_time now);
/* The drive must stand from now on, see station_add_stop(). Others see this at once, not with the
 * drive's next answer, which may never arrive. */
void engine_add_stop(struct db_engine *engine, struct station *station, enum db_command command,
                     enum db_stand_cause cause, struct db_request *request, db_time now);
/* True if a drive may want more than to be read. */
bool engine_has_active_drives(struct db_engine *engine);
/* Ends the requests that wait for a drive that cannot do them now. */
void engine_finish_waiting_requests(struct db_engine *engine, const struct station *station,
                                    enum db_result result, db_time now);
/* Received bytes that belong to no frame. */
void engine_count_garbage(struct db_engine *engine, const uint8_t *bytes, size_t length,
                          db_time now);

/* A request is about to be sent: bytes still in the buffer were sent before it. Where another
 * answer is awaited they may belong to that, and stay. */
static inline void engine_discard_received(struct db_engine *engine, db_time now)
{
	if (engine->flights > 0 || engine->received_length == 0)
		return;
	engine_count_garbage(engine, engine->received, engine->received_length, now);
	engine->received_length = 0;
}

/* Sends bytes and records each frame in the trace. Returns the number of the last frame there. */
uint32_t engine_send(struct db_engine *engine, const uint8_t *bytes, size_t length,
                     enum db_trace_kind why);

/* The node is to be read. */
void engine_mark_for_reading(struct db_engine *engine, struct node *node);
/* The node was read, or no longer has to be: the round is over when this is true of all nodes. */
void engine_end_read(struct db_engine *engine, struct node *node, db_time now);

/*
 * The station's current request is a parameter write: the waiting writes join it, up to the first
 * request that must not be done before the others have ended: a command, or a write to a parameter
 * that is already being written.
 */
void engine_join_waiting_writes(struct db_engine *engine, struct station *station);

/* --- exchange.c: a request on the wire and its answer ---------------------------------------- */

/* The driver prepares an exchange in a lane of its drive; it is sent, and it ends. */

/*
 * On CAN requests to several drives are under way at once. This amount of work, as time on the
 * wire, is handed to the port ahead: enough to keep the wire busy while this thread wakes up, and
 * little enough for a stop not to wait long after it.
 */
#define EXCHANGE_AHEAD (1 * DB_NS_PER_MS)

/* True if several exchanges may be under way, one for each drive (CAN). */
static inline bool exchange_overlaps(const struct db_engine *engine)
{
	return engine->driver->medium == DB_MEDIUM_CAN;
}

/* The earliest time at which an exchange, or a stop, may be sent; DB_TIME_NEVER: only after an
 * event. */
static inline db_time exchange_may_begin_at(const struct db_engine *engine, bool stop, db_time now)
{
	if (engine->port_full_since != 0)
		return DB_TIME_NEVER;
	if (now < engine->quiet_until)
		return engine->quiet_until;
	if (!stop && now < engine->reserved.until)
		return engine->reserved.until;
	if (engine->flights == 0)
		return now;
	if (!exchange_overlaps(engine))
		return DB_TIME_NEVER;
	return stop || engine->wire_free - EXCHANGE_AHEAD <= now ?
	               now :
	               engine->wire_free - EXCHANGE_AHEAD;
}

/* Reserves the line until then for an exchange, or with LANE_COMMAND and no station (null) for a
 * frame to all drives. */
void exchange_reserve(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time until, db_time now);
/* Sends the exchange for which the line was reserved. */
bool exchange_send_reserved(struct db_engine *engine, db_time now);
/* True if its stop is prepared and no waiting stop can be sent yet. */
bool exchange_stop_waits(const struct db_engine *engine, const struct station *station,
                         db_time now);

/* Time of an exchange on the wire, without the drive's response time. */
static inline db_time exchange_wire_time(const struct db_engine *engine,
                                         const struct db_exchange *exchange)
{
	return engine->bus->transport->wire_time(engine->bus, exchange->request,
	                                         exchange->request_length, exchange->answer_length);
}

/* Lets the driver begin a job; its first exchange is prepared when the driver returns SEND. */
enum db_step exchange_begin_job(struct db_engine *engine, struct station *station,
                                enum lane_kind kind, enum db_job_kind job,
                                const struct db_request *request, db_time now,
                                enum db_result *result);
/* Sends a lane's prepared exchange, or reserves the line for it until the drives can receive. True:
 * it was sent. */
bool exchange_send(struct db_engine *engine, struct station *station, enum lane_kind kind,
                   db_time now);
/* The same, but sends a probe first where the node is out of step. */
void exchange_send_in_step(struct db_engine *engine, struct station *station, enum lane_kind kind,
                           db_time now);
void exchange_send_probe(struct db_engine *engine, struct node *node, db_time now);
/* The node's exchange is no longer under way. */
void exchange_end(struct db_engine *engine, struct node *node, db_time now);

/* A frame without an answer is sent: `to_all` drives, which get time to act on it before the next
 * request, or to one while others wait for answers (CAN). */
void exchange_count_unanswered(struct db_engine *engine, const struct db_exchange *exchange,
                               bool to_all, db_time now);

/* On a serial line a stop waits for the exchange that is under way. So while a drive of the line
 * moves, or is being stopped, no exchange is begun that takes the line longer than two status
 * reads. Where exchanges overlap (CAN) no stop waits, and nothing is forbidden. */
bool exchange_must_be_short(const struct db_engine *engine);
/* True if this prepared exchange is too long to be sent now. */
bool exchange_is_too_long(const struct db_engine *engine, const struct db_exchange *exchange);

/* --- gaps.c: when the drives of a serial line can receive ------------------------------------ */

/*
 * What their answers and losses show about it, and how long the line is left silent for it. Drives
 * on CAN receive while they send, and nothing here has an effect.
 */

/* The node's exchange was answered; call before the exchange is forgotten. True: the node is to be
 * asked again at once, to prove that it can receive so soon. */
bool gaps_answered(struct db_engine *engine, struct node *node, db_time now);
/* The node's exchange was lost; call before the exchange is forgotten. */
void gaps_lost(struct db_engine *engine, struct node *node, db_time now);
/* The node has answered: no request is sent until the other drives can receive, or, where the node
 * is to prove itself, until this one can. */
void gaps_keep_silence(struct db_engine *engine, struct node *node, bool proves, db_time now);

/* The time from which no drive that has just sent can take the rest of the request for one to
 * itself, should it miss the beginning. */
db_time gaps_harmless_at(const struct db_engine *engine, unsigned address, const uint8_t *request,
                         size_t length, db_time now);
/* When this drive is sure to receive, or with null every drive of the line. */
db_time gaps_over_at(const struct db_engine *engine, const struct node *node, db_time now);

/* --- answer.c: frames received from the wire, and answers that are missing ------------------- */

/* The driver has cut a frame out of the stream. Sends nothing. */
void answer_receive(struct db_engine *engine, const uint8_t *frame, size_t length, db_time now);
/* The node's exchange was not answered in time. */
void answer_lost(struct db_engine *engine, struct node *node, db_time now);

/* --- messages.c: what the bus itself sends --------------------------------------------------- */

/* The port was opened: each is due. */
void messages_begin(struct db_engine *engine, db_time now);
/* Sends one that is due (next_message_at); the wire is free. */
bool messages_send(struct db_engine *engine, db_time now);

/* --- stop.c: stops, ahead of everything else ------------------------------------------------- */

/*
 * Sends and reads what the records of drives that must stand (standing.h) require. Drives take
 * turns, one exchange each: a drive that does not answer does not delay another drive's stop.
 */

/* Sends the most urgent stop, or reads a drive that must stand. False when there is none. */
bool stop_send_next(struct db_engine *engine, db_time now);
/* When the station wants to send or read, if nothing else prevents it. */
db_time stop_run_at(const struct db_engine *engine, const struct station *station, db_time now);
/* True if no drive has a stop that was never sent. */
bool stop_all_are_sent(const struct db_engine *engine);
/* The conversation of a stop has ended. */
void stop_answered(struct db_engine *engine, struct station *station, enum db_result result,
                   db_time now);
/* A frame sent to this node was not answered, which used `cost` of the wire. `stop`: it was a
 * stop. */
void stop_lost(struct db_engine *engine, struct node *node, bool stop, db_time cost, db_time now);
/* The drive was read; the request was sent at `asked`. */
void stop_judge(struct db_engine *engine, struct station *station, db_time asked, db_time now);

/* --- common_start.c: motions of a group that begin with one frame ---------------------------- */

/* True if the drive's next frame begins a motion that may begin on all drives at once: the frame is
 * held until then. */
bool common_start_holds(const struct station *station);
/* On buses that have common starts: begins one for which all drives are ready. *wait: nothing else
 * may be sent now. True: a frame was sent. */
bool common_start_try(struct db_engine *engine, bool *wait, db_time now);
/* When a drive has waited long enough for the others; DB_TIME_NEVER. */
db_time common_start_run_at(const struct db_engine *engine, db_time now);

/* --- schedule.c: what is sent next ----------------------------------------------------------- */

/* A command that repeats a question because its effect does not show yet does so after this pause
 * while nothing else is to be sent: a drive does not answer sooner because it is asked all the
 * time, and traces and other nodes are spared. */
#define SCHEDULE_AGAIN_PAUSE (2 * DB_NS_PER_MS)

/* Sends what is most urgent. False when there is nothing to be sent now. */
bool schedule_send_next(struct db_engine *engine, db_time now);

/* A cycle begins: marks drives that are to be read again, each in its class (moving or
 * standing). */
void schedule_begin_cycle(struct db_engine *engine, db_time now);

#endif
