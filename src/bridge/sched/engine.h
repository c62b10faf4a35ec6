/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The schedule of one bus, without threads, descriptors or clocks: the caller passes in what
 * arrived and the time; the engine sends through a callback and returns when it wants to be called
 * again.
 *
 * Stops go first; the classes of drivebridge/shares.h share the time that is left, each according
 * to its part of the wire. On a serial line one exchange is under way at a time, on CAN one for
 * each drive.
 *
 * After a lost answer a drive is "out of step": its answer may still arrive and would be taken for
 * the next exchange's. The drive is then first sent a probe, whose answer cannot be confused
 * (DB_JOB_PROBE).
 */
#ifndef DRIVEBRIDGE_SCHED_ENGINE_H
#define DRIVEBRIDGE_SCHED_ENGINE_H

#include "drivebridge/bus.h"
#include "drivebridge/driver.h"
#include "drivebridge/log.h"
#include "drivebridge/trace.h"
#include "drivebridge/trouble.h"
#include "sched/queue.h"

struct db_engine;

/* A received frame that could not be used, unchanged. */
struct db_unusable {
	uint8_t bytes[24];
	size_t length;  /* of the bytes kept */
	uint32_t count; /* number of such frames since the drive last answered */
};

/* A time in which a drive did not answer, and that is over. */
struct db_outage {
	enum db_trouble_cause cause; /* of its silence, as known last */
	db_time time;                /* measured from its last data */
};

/* How a drive does not keep to the times of the configuration: it answers too late (DRIVE_LATE), or
 * requests that follow its answers too soon are not received (DRIVE_DEAF). */
struct db_engine_timing {
	enum db_event event;
	/* DRIVE_DEAF: other drives do not receive them, so this one may hold the line. */
	bool others;
	db_time time;
	db_time learnt; /* what it is allowed from now on; 0: only the configuration can help */
};

struct db_engine_ops {
	/* Sends bytes and returns when they are sent. The engine expects transmission to begin at
	 * once. */
	db_time (*send)(void *context, const uint8_t *bytes, size_t length);
	/* An event of a drive, for the log; each is reported once. `outage`: the outage that ended
	 * with it (ONLINE), else null. May be null. */
	void (*on_event)(void *context, const struct db_drive_config *drive, enum db_event event,
	                 const struct db_feedback *feedback, const struct db_outage *outage);
	/* A drive was asked for these parameters (a set as in db_nameplate) and did not report
	 * them. May be null. */
	void (*on_missing_params)(void *context, const struct db_drive_config *drive,
	                          const uint64_t *params);
	/* Something was received from a drive that does not answer: the last frame from its address
	 * that could not be used (only its beginning if it is long). May be null. */
	void (*on_unusable)(void *context, const struct db_drive_config *drive,
	                    const struct db_unusable *unusable);
	/* A drive does not keep to the times of the configuration. May be null. */
	void (*on_timing)(void *context, const struct db_drive_config *drive,
	                  const struct db_engine_timing *timing);
	/* A client's raw frame was sent (`sent`), or this is its answer; length 0: no answer. May
	 * be null. */
	void (*on_raw_frame)(void *context, const struct db_drive_config *drive, bool sent,
	                     const uint8_t *bytes, size_t length);
};

/* The bus's configuration and the queue must outlive the engine. 0 or -ENOMEM. */
int db_engine_new(const struct db_bus_config *bus, const struct db_bus_drive *drives,
                  size_t drive_count, struct db_queue *queue, const struct db_engine_ops *ops,
                  void *context, struct db_engine **engine);
void db_engine_free(struct db_engine *engine);

/* The port was opened (error 0) or lost. */
void db_engine_port(struct db_engine *engine, bool up, int error, db_time now);

/* The port takes no more bytes (`hold`), or has taken everything that send() was given. While it
 * holds, nothing is sent, and the time-outs of answers are extended by that time. May be called
 * within send(). */
void db_engine_hold(struct db_engine *engine, bool hold, db_time now);

/* Bytes received from the wire. */
void db_engine_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now);

/* Maximum length in bytes of the answer that is awaited on a serial line; *come: number of received
 * bytes that may be its beginning. 0: no answer is awaited. */
size_t db_engine_awaited(const struct db_engine *engine, size_t *come);

/* True while a drive that was probed several times without an answer is being asked or may answer:
 * any bytes received then may show the reason. */
bool db_engine_wants_all_frames(const struct db_engine *engine, db_time now);

/* Does what is due. Returns when it must be called again at the latest. */
db_time db_engine_run(struct db_engine *engine, db_time now);

/* From now on only what each drive's on_exit requires is sent. */
void db_engine_shut_down(struct db_engine *engine, db_time now);
/* True if the shutdown is complete; `cleared`: for all drives that answer. */
bool db_engine_is_quiet(const struct db_engine *engine, bool cleared);
/* The shutdown is complete, or its time is up. The engine does not end, but its bus is down until
 * the port is available for its drives again. */
void db_engine_set_aside(struct db_engine *engine, db_time now);
/* Reports each drive that is released now although it has not confirmed its on_exit. */
void db_engine_report_unconfirmed(struct db_engine *engine);

/* The trace of the frames on the bus, recorded from now on. Lives as long as the engine. */
struct db_trace *db_engine_trace(const struct db_engine *engine);

void db_engine_stats(const struct db_engine *engine, struct db_bus_stats *stats);

#endif
