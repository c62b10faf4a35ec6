/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the scheduler knows of the other end: a node is one address on the bus, which answers or does
 * not; a station is one drive there. Nearly always a node has one station; a controller with several
 * axes is one node with a station for each. Internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_STATION_H
#define DRIVEBRIDGE_SCHED_STATION_H

#include "drivebridge/bus.h"
#include "drivebridge/driver.h"
#include "drivebridge/trouble.h"
#include "sched/doubled.h"
#include "sched/engine.h"
#include "sched/queue.h"
#include "sched/standing.h"

/* A conversation with a drive. Those of different lanes may interleave, exchange by exchange. Polls
 * and probes are the first station's of a node, for all of them. */
enum lane_kind { LANE_STOP, LANE_POLL, LANE_IDENTIFY, LANE_PROBE, LANE_COMMAND, LANE_COUNT };

struct lane {
	bool active;    /* begun, not ended */
	bool ready;     /* its next exchange is prepared and waits to be sent */
	bool sent;      /* something of the job was */
	unsigned tries; /* how often the prepared exchange was repeated */
	struct db_job job;
	struct db_exchange exchange;
};

/* Who waits for a stop of the drive. */
struct stop_waiter {
	struct db_queued *queued;
	enum db_command command;
};

struct station;

/* An exchange on the wire. */
struct flight {
	struct station *station; /* null: nothing is under way */
	enum lane_kind lane;
	bool trusted; /* an answer proves something: the node was in step */
	db_time sent;
	db_time wire; /* its share of that, without the drive's thinking */
	db_time deadline;
	uint32_t question; /* its number in the trace */
};

struct node {
	unsigned address;
	struct node *next_spare; /* another spare one, freed with it */
	struct station *first;   /* the others follow, linked by next_axis */
	struct db_device
		*head;        /* the first drive's; polls for all, and stays when that drive goes */
	struct flight flight; /* one exchange at a time */

	bool online;
	bool in_step;
	bool ever_probed;
	unsigned losses; /* in a row */

	/*
	 * Answers that may still come. Drives answer in the order of the questions, so the answer to a
	 * probe says that nothing older is on its way, if it is the answer to *that* probe: as long as
	 * a lost status or command may be answered, an answer is first taken for that of an earlier
	 * lost probe.
	 */
	db_time late_answer_time; /* how late an answer can be */
	db_time risky_until;  /* a lost exchange other than a probe may be answered until then */
	unsigned late_probes; /* lost probes that may be answered */
	db_time late_probes_until; /* after that, none will be */

	/* For advice: the exchange lost last, and how requests fared that followed an answer at once. */
	db_time lost_sent; /* 0: none */
	uint32_t lost_question;
	db_time lost_wire;
	db_time answered; /* when it answered last */
	unsigned soon_answers;
	unsigned soon_losses;
	unsigned later_losses;

	bool poll_due;
	db_time polled; /* when the last poll was sent */

	struct db_heard heard; /* from its address, while it does not answer */
	enum db_trouble_cause
		timing;   /* LATE or DEAF: what its losses show, until it is online; else NONE */
	unsigned late_ms; /* how late its last answer was that came after it was given up */
	struct doubled doubled;

	db_time probe_at;
	db_time probe_backoff;
};

/* What was said of a drive last, so that only changes are. */
struct last_logged {
	bool online;
	bool missing; /* it was told that it does not answer */
	uint16_t error;
	uint32_t status;
	uint32_t restarts;
	uint32_t doubts;
	uint64_t missing_params;
};

struct station {
	uint16_t number; /* as requests name it */
	bool leaving;    /* to be taken out as soon as it can be */
	struct node *node;
	struct node *spare;        /* in case that it is the first at its address; freed with it */
	struct station *next_axis; /* at the same address */
	const struct db_drive_config *config;
	struct db_axis *axis;
	struct db_device *device; /* null once its node keeps it as its head */
	struct db_snapshot snapshot;
	struct last_logged last_logged;
	struct lane lanes[LANE_COUNT];
	uint8_t requests[LANE_COUNT - 1][DB_SHORT_REQUEST]; /* LANE_COMMAND has its request's */

	uint32_t generation; /* of the nameplate published last */
	bool plate_published;
	bool command_cancelled;
	db_time identify_at; /* not before: the last attempt failed */
	db_time identify_backoff;

	struct db_queued *queued;
	db_time command_ended; /* the last one */

	struct standing standing;
	struct stop_waiter stops[DB_QUEUE_STOPS_EACH];
	unsigned stop_count;
	bool blind_stop_sent; /* a stop went out while out of step; its answer proves nothing */
	db_time motion_sent;  /* when it was last told to move */
	bool alone;           /* its command waits for no others any more */

	uint64_t round_trips;
	uint64_t round_trip_sum_us; /* of those */
};

/* No drive is later than so many times the configured latency: what was not answered by then never
 * will be. */
#define LATE_ANSWER_LATENCIES 4

/* How often an offline drive is looked for: at first, and at most. */
#define PROBE_BACKOFF_MIN (100 * DB_NS_PER_MS)
#define PROBE_BACKOFF_MAX (2 * DB_NS_PER_S)

/* How long a drive that did not tell its parameters is left alone, at first and at most. */
#define IDENTIFY_BACKOFF_MIN (500 * DB_NS_PER_MS)
#define IDENTIFY_BACKOFF_MAX (30 * DB_NS_PER_S)

/* --- nodes ------------------------------------------------------------------------------------- */

/* With no station yet. Null when out of memory. */
struct node *node_new(const struct db_bus_config *bus, unsigned address);
/* Its head too; not its stations. */
void node_free(struct node *node);

/* An exchange went without its answer; `probe` tells which kind it was. */
void node_expect_late_answer(struct node *node, bool probe, db_time now);
/* Another node takes its place at its address: answers to the old one may still come. */
void node_inherit_late_answers(struct node *node, const struct node *from);
/* Until when it is no use to send a probe, because its answer could not be told from a late answer. */
db_time node_late_answers_until(const struct node *node, db_time now);
/* It must be asked a probe first, and the answer could not be told from an earlier one's yet. */
bool node_waits_out_late_answers(const struct node *node, db_time now);
/* Whether the answer that just came to a probe may be an earlier probe's. */
bool node_is_late_answer(struct node *node, db_time now);

/* One of its drives must. */
bool node_must_stand(const struct node *node);
/* One of its drives was sent a stop while the node was out of step, and is asked about it. */
bool node_was_sent_blind_stop(const struct node *node);

/* The exchange that just ended was answered, or lost. */
void node_note_answer(struct node *node, db_time now);
void node_note_loss(struct node *node);
/* The latency of a frame that nobody waited for, as the answer to the exchange lost last; 0: it is
 * none. */
db_time node_late_by(const struct node *node, db_time now);
/* It loses what follows its answers at once, and nothing else. Counting begins anew then. */
bool node_is_deaf(struct node *node);

/* --- stations ---------------------------------------------------------------------------------- */

/* With a spare node, at no node yet. Null when out of memory. Any thread. */
struct station *station_new(const struct db_bus_config *bus, const struct db_bus_drive *drive);
void station_free(struct station *station);

/* Becomes one of the node's. */
void station_join(struct station *station, struct node *node, const struct db_bus_config *bus);
/* The opposite; a node without stations becomes its spare one. True then. */
bool station_part(struct station *station, const struct db_driver *driver);

/* The conversation of a lane's job, with the device that does this kind of job. */
struct db_conversation station_conversation(struct station *station, enum lane_kind kind,
                                            db_time now);

/* Copies what the driver knows to the other threads. */
struct bus_moment {
	bool up;
	bool aside; /* for a scan */
	int64_t wall_offset_us;
	db_time now;
};
void station_publish(struct station *station, const struct db_driver *driver,
                     const struct bus_moment *bus);

void station_count_answer(struct station *station, db_time round_trip);

/* The drive must stand from now on; the request that waits for it may be null. What is queued or running for the
 * drive is the caller's. */
void station_add_stop(struct station *station, enum db_command command, enum db_stand_cause cause,
                      struct db_queued *queued, db_time now);
/* A stop is on the wire, and those who wait for one learn it. */
void station_note_stop_sent(struct station *station, bool trusted, db_time now);
/* Ends the stops that wait: those of this command, or with DB_CMD_NONE all but a disable, which ends when the power
 * is known to be off. */
void station_finish_stops(struct station *station, enum db_command command, enum db_result result,
                          db_time now);
/* It was read since its last command ended, and nothing is being said to it that could set it going. */
bool station_is_read(const struct station *station);
/* And it stood. */
bool station_is_seen_to_stand(const struct station *station);

/* Nothing else is to be said to the drive before its stop has had an effect, or was seen to have none. */
bool station_awaits_stop(const struct station *station);
/* How long it may take to obey, and so on. */
struct standing_rules station_rules(const struct station *station, const struct db_driver *driver,
                                    db_time now);

/* Ends the stops that wait, whether or not they went out. */
void station_drop_stops(struct station *station, db_time now);

/* The running command or parameter write is on the wire now. */
bool station_command_flies(const struct station *station);
/* Ends the running command or parameter write, if there is one. */
void station_finish_command(struct station *station, enum db_result result, db_time now);
/* A stop or the end overtakes it: ends it, or lets it end as cancelled when it is on the wire. */
void station_cancel_command(struct station *station, db_time now);

/* Ends a running command whose drive is lost: the driver says what is known of its fate. */
void station_abandon_command(struct station *station, const struct db_driver *driver,
                             enum db_result unless_known, db_time now);

#endif
