/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the schedule of one bus knows, and what all parts of it do with it: find drives, publish them, tell of
 * them, end what waits for them. Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_STATE_H
#define DRIVEBRIDGE_SCHED_STATE_H

#include "sched/engine.h"
#include "sched/station.h"

/* An answer, and garbage before it. */
#define RECEIVE_MAX (DB_ANSWER_MAX + 512)

struct scan;

struct db_engine {
	const struct db_bus_config *bus;
	const struct db_driver *driver;
	struct db_queue *queue;
	const struct db_engine_ops *ops;
	void *context;
	int64_t wall_offset_us;
	struct db_trace *trace;
	struct db_bus_stats stats;
	db_time now; /* of the call from outside that is under way */

	unsigned flights;   /* exchanges under way */
	unsigned sendings;  /* numbers them */
	db_time wire_free;  /* when the wire would have carried them all, if nobody had to think */
	db_time held_since; /* the port cannot take more; 0 = it can */

	db_time quiet_until; /* a broadcast is on the wire, or drives turn from sending to receiving */
	uint8_t received[RECEIVE_MAX];
	size_t received_length;

	struct db_queued **waiting; /* taken, not begun; in order of arrival */
	size_t waiting_count;
	size_t waiting_max;

	db_time period;
	db_time cycle_at; /* when the next cycle is due; 0 before the first */
	db_time cycle_started;
	bool polling; /* this cycle's polls are not all answered */
	unsigned polls_in_a_row;
	bool command_was_last;
	db_time again_sent; /* when a command last asked again for what did not show yet */
	bool continued;     /* the last of the commands' exchanges was not the first of one */

	db_time probes_from;      /* the share for offline drives is used up until then */
	db_time dumps_held_since; /* long readings wait until all drives stand */
	db_time dump_tried;       /* the last time that one had to wait; 0: never */
	db_time stops_from; /* the share for stops to drives that are offline is used up until then */
	bool stop_was_last; /* the last exchange that began was of a stop */
	db_time busy;       /* time with an exchange on the wire in this second */
	db_time second_at;

	bool shutting_down;
	size_t next_poll; /* where round robin goes on */
	size_t next_command;
	size_t next_stop;
	size_t next_watched;
	size_t next_identify;
	size_t next_probe;
	struct node **nodes; /* in order of their first drive's coming */
	size_t node_count;
	struct station **stations; /* in order of coming */
	size_t station_count;
	struct db_change *change;  /* under way */
	struct db_change *changed; /* carried out, not fetched */
	struct scan *scan;         /* under way, see scan.h; null */
};

static inline bool is_flying(const struct node *node)
{
	return node->flight.station != NULL;
}

/* The drive of this number, or null. */
struct station *engine_find_station(const struct db_engine *engine, uint16_t number);
/* One that answers and moves; null: none does. */
const struct station *engine_find_moving(const struct db_engine *engine);

/* Shows what the driver knows, and tells what is new in it. */
void engine_publish(struct db_engine *engine, struct station *station);
/* The station is let go: tells when its on_exit is still to be confirmed. */
void engine_tell_unconfirmed(struct db_engine *engine, const struct station *station);
/* Tells that this happened to it, with what is shown of it. */
void engine_tell_event(struct db_engine *engine, const struct station *station,
                       enum db_event event);
/* Tells of a drive that does not keep to the times of the configuration. */
void engine_tell_timing(struct db_engine *engine, struct station *station, enum db_event event,
                        db_time time);
/* Tells that a drive does not answer, unless that was told since it last did. */
void engine_tell_missing(struct db_engine *engine, struct station *station);
/* Tells of a raw frame, if the command under way is one; see tell_raw. */
void engine_tell_raw(struct db_engine *engine, const struct station *station, bool sent,
                     const uint8_t *bytes, size_t length);

/* A node has answered, or does not answer any more; its drives' commands end with `result`. */
void engine_bring_online(struct db_engine *engine, struct node *node, db_time now);
void engine_take_offline(struct db_engine *engine, struct node *node, enum db_result result,
                         db_time now);
/* A drive is there, as one of a node that answers. */
void engine_count_online(struct db_engine *engine, struct station *station, db_time now);
/* Ends what waits for a drive that cannot do it now. */
void engine_finish_waiting(struct db_engine *engine, const struct station *station,
                           enum db_result result, db_time now);
/* Bytes came that belong to no frame. */
void engine_take_garbage(struct db_engine *engine, const uint8_t *bytes, size_t length,
                         db_time now);

/* Sends, and traces each frame of it: the number of the last one there. */
uint32_t engine_send(struct db_engine *engine, const uint8_t *bytes, size_t length,
                     enum db_trace_kind why);

/* The cycle is over when all its polls are. */
void engine_end_cycle(struct db_engine *engine, db_time now);

#endif
