/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The schedule of one bus, without threads, descriptors or clocks: it is told what arrived and what
 * time it is, sends through a callback, and says when it wants to be called again.
 *
 * Classes, first to last: stops; commands and parameter writes; cyclic status; reading identity and
 * parameters; looking for drives that are offline; a scan. On a serial line one exchange is under way at a
 * time, on CAN one for each drive.
 *
 * After a lost answer a drive is "out of step": its answer may still come and would be taken for the
 * next one's. It is then first asked something whose answer cannot be confused (DB_JOB_PROBE).
 */
#ifndef DRIVEBRIDGE_SCHED_ENGINE_H
#define DRIVEBRIDGE_SCHED_ENGINE_H

#include "drivebridge/bus.h"
#include "drivebridge/driver.h"
#include "drivebridge/log.h"
#include "drivebridge/trace.h"
#include "sched/queue.h"

struct db_engine;

/* A frame that was of no use, as it came. */
struct db_heard {
	uint8_t bytes[24];
	size_t length;  /* of what is kept */
	uint32_t count; /* of such frames since the drive last answered */
};

struct db_engine_ops {
	/* Puts bytes on the wire, and returns when. The engine expects them to start at once. */
	db_time (*send)(void *context, const uint8_t *bytes, size_t length);
	/* Something happened to a drive, for the log; it is seen once. May be null. */
	void (*tell)(void *context, const struct db_drive_config *drive, enum db_event event,
	             const struct db_feedback *feedback);
	/* A drive was asked for these parameters (bits as in db_nameplate) and did not tell them. May be
	 * null. */
	void (*tell_missing)(void *context, const struct db_drive_config *drive, uint64_t params);
	/* A drive that does not answer was heard all the same: the last frame that came from its
	 * address and could not be used (its beginning, when it is long). May be null. */
	void (*tell_heard)(void *context, const struct db_drive_config *drive,
	                   const struct db_heard *heard);
	/* A drive does not keep to the times of the configuration: it answers so late (DRIVE_LATE), or
	 * does not hear what is asked so soon behind an answer (DRIVE_DEAF). May be null. */
	void (*tell_timing)(void *context, const struct db_drive_config *drive, enum db_event event,
	                    db_time time);
	/* A client's own frame is on its way (sent), or was answered by this; of length 0: by nothing. May
	 * be null. */
	void (*tell_raw)(void *context, const struct db_drive_config *drive, bool sent,
	                 const uint8_t *bytes, size_t length);
};

/* The bus's configuration and the queue must outlive the engine. 0 or -ENOMEM. */
int db_engine_new(const struct db_bus_config *bus, const struct db_bus_drive *drives,
                  size_t drive_count, struct db_queue *queue, const struct db_engine_ops *ops,
                  void *context, struct db_engine **engine);
void db_engine_free(struct db_engine *engine);

/* The port was opened (error 0) or lost. `wall_offset_us` turns monotonic into wall time. */
void db_engine_port(struct db_engine *engine, bool up, int error, db_time now);
void db_engine_set_wall_offset(struct db_engine *engine, int64_t wall_offset_us);

/* The port takes no more (hold), or has taken all that send() was given: until then nothing is sent,
 * and answers are waited for so much longer. Also within send(). */
void db_engine_hold(struct db_engine *engine, bool hold, db_time now);

/* Bytes came from the wire. */
void db_engine_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now);

/* Does what is due. Returns when to be called again at the latest. */
db_time db_engine_run(struct db_engine *engine, db_time now);

/* From now on only what each drive's on_exit asks for is sent. */
void db_engine_shut_down(struct db_engine *engine, db_time now);
/* Nothing is left to be done of it. */
bool db_engine_is_quiet(const struct db_engine *engine);
/* Nothing is left to be done of it for drives that answer. */
bool db_engine_is_cleared(const struct db_engine *engine);
/* What was asked for the end is done, or its time is up; the engine does not end, but its bus is down until
 * the port is there for its drives again. */
void db_engine_set_aside(struct db_engine *engine, db_time now);
/* Tells of each drive that is let go now though it has not confirmed its on_exit. */
void db_engine_tell_unconfirmed(struct db_engine *engine);

/* What the bus carried last, from here on. Lives as long as the engine. */
struct db_trace *db_engine_trace(const struct db_engine *engine);

void db_engine_stats(const struct db_engine *engine, struct db_bus_stats *stats);

#endif
