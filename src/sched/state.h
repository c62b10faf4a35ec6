/* SPDX-License-Identifier: Apache-2.0 */
/* The engine's inside, shared by engine.c, choose.c and answer.c. Internal to src/sched. */
#ifndef DRIVEBRIDGE_SCHED_STATE_H
#define DRIVEBRIDGE_SCHED_STATE_H

#include "sched/change.h"
#include "sched/engine.h"
#include "sched/station.h"

#define RECEIVE_MAX (2 * DB_ANSWER_MAX)

struct db_engine {
	const struct db_bus_config *bus;
	const struct db_driver *driver;
	struct db_mailbox *mailbox;
	const struct db_engine_ops *ops;
	void *context;
	int64_t wall_offset_us;
	struct db_bus_stats stats;

	unsigned flights;   /* exchanges under way */
	unsigned sendings;  /* numbers them */
	db_time wire_free;  /* when the wire would have carried them all, if nobody had to think */
	db_time held_since; /* the port cannot take more; 0 = it can */

	db_time quiet_until; /* a broadcast is on the wire, or drives turn from sending to receiving */
	uint8_t received[RECEIVE_MAX];
	size_t received_length;

	struct db_letter **waiting; /* taken, not begun; in order of arrival */
	size_t waiting_count;
	size_t waiting_max;

	db_time period;
	db_time cycle_at; /* when the next cycle is due; 0 before the first */
	db_time cycle_started;
	bool polling; /* this cycle's polls are not all answered */
	unsigned polls_in_a_row;
	bool front_was_last;
	db_time again_sent; /* when a command last asked again for what did not show yet */
	bool continued;     /* the last of the commands' exchanges was not the first of one */

	db_time probes_from;      /* the share for offline drives is used up until then */
	db_time dumps_held_since; /* long readings wait until all drives stand */
	db_time dump_tried;       /* the last time that one had to wait; 0: never */
	db_time stops_from;       /* likewise the share for stops to drives that are offline */
	db_time busy;             /* time with an exchange on the wire in this second */
	db_time second_at;

	bool shutting_down;
	size_t next_poll; /* where round robin goes on */
	size_t next_front;
	size_t next_stop;
	size_t next_identify;
	size_t next_probe;
	struct node **nodes; /* in order of their first drive's coming */
	size_t node_count;
	struct station **stations; /* in order of coming */
	size_t station_count;
	struct db_change *change;  /* under way */
	struct db_change *changed; /* carried out, not fetched */
};

static inline bool is_flying(const struct node *node)
{
	return node->flight.station != NULL;
}

/* engine.c */
/* The drive of this number, or null. */
struct station *engine_station(const struct db_engine *engine, uint16_t number);
/* Shows what the driver knows, and tells what is new in it. */
void engine_publish(struct db_engine *engine, struct station *station);
/* The station is let go: tells when its on_exit is still to be confirmed. */
void engine_tell_unconfirmed(struct db_engine *engine, const struct station *station);
/* Tells of a drive that does not keep to the times of the configuration. */
void engine_tell_timing(struct db_engine *engine, struct station *station, enum db_event event,
                        db_time time);
/* Tells that a drive does not answer, unless that was told since it last did. */
void engine_tell_missing(struct db_engine *engine, struct station *station);
/* Tells of a raw frame, if the command under way is one; see tell_raw. */
void engine_tell_raw(struct db_engine *engine, const struct station *station, bool sent,
                     const uint8_t *bytes, size_t length);
/* Ends what waits for a drive that cannot do it now. */
void engine_finish_waiting(struct db_engine *engine, const struct station *station,
                           enum db_result result, db_time now);
/* The cycle is over when all its polls are. */
void engine_end_of_polls(struct db_engine *engine, db_time now);

/* choose.c */
/* Several exchanges may be under way, one for each drive (CAN). */
bool engine_is_shared(const struct db_engine *engine);
/* Sends what is most urgent. False when nothing is to be sent now. */
bool engine_send_something(struct db_engine *engine, db_time now);
/* When something may be sent at the earliest, DB_TIME_NEVER: when something has happened. */
db_time engine_may_send_at(const struct db_engine *engine, bool stop, db_time now);
/* Lets the driver begin a job; its first exchange is prepared when it says SEND. */
enum db_step engine_begin_job(struct db_engine *engine, struct station *station,
                              enum lane_kind kind, enum db_job_kind job,
                              const struct db_request *request, db_time now,
                              enum db_result *result);
/* Puts a prepared exchange on the wire. */
void engine_send_lane(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time now);
void engine_send_probe(struct db_engine *engine, struct node *node, db_time now);
/* How long an exchange takes on the wire, without the drive's thinking. */
db_time engine_wire_time(const struct db_engine *engine, const struct db_exchange *exchange);

/* When somebody has waited long enough for others of a common start. */
db_time engine_common_wake(const struct db_engine *engine, db_time now);

/* stop.c */
/* A frame for all drives goes out: they are given time to act on it before they are asked something. */
void engine_after_broadcast(struct db_engine *engine, const struct db_exchange *exchange,
                            db_time now);
/* Sends the most urgent stop, or reads a drive that is to be seen to stop. False when there is none. */
bool engine_send_stop(struct db_engine *engine, db_time now);
/* When the station wants that, if nothing else is in its way. */
db_time engine_stop_wake(const struct db_engine *engine, const struct station *station,
                         db_time now);
/* Who asked for it learns that the stop of this command is on the wire. */
void engine_note_stop_sent(struct station *station, enum db_command command, db_time now);
/* The conversation of a stop came to its end. */
void engine_stop_answered(struct db_engine *engine, struct station *station, enum db_result result,
                          db_time now);
/* The drive was read: does it stop? */
void engine_judge_stop(struct db_engine *engine, struct station *station, db_time now);
/* It is to move again: whether it has stopped is of no interest any more. */
void engine_forget_stop(struct station *station);

/* change.c */
/* Takes out who can leave now; when nobody leaves any more, takes in who comes. */
void engine_carry_change(struct db_engine *engine, db_time now);
/* When it is to be looked at again at the latest. */
db_time engine_change_deadline(const struct db_engine *engine, db_time now);

/* answer.c */
/* The drive is there, as one of a node that answers. */
void engine_come_online(struct db_engine *engine, struct station *station, db_time now);
/* The exchange is not under way any more. */
void engine_end_flight(struct db_engine *engine, struct node *node, db_time now);
void engine_go_offline(struct db_engine *engine, struct node *node, enum db_result result,
                       db_time now);
/* No answer came in time. */
void engine_answer_lost(struct db_engine *engine, struct node *node, db_time now);

#endif
