/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A bus in simulated time: the real engine and queue, a configuration that may be changed before
 * these are made, axes, and a wire on which answers arrive when they are due. Unless a test has ops
 * of its own, its drives use struct fake_frame. One thread; without memory or after wrong use it
 * aborts.
 *
 *	struct fake_bus *bus = fake_bus_new(&fake_family, 2);
 *
 *	bus->config.cycle_ms = 4;
 *	fake_bus_open(bus, 2, NULL);
 *	fake_port(bus, 0);
 *	fake_pass(bus, 300 * DB_NS_PER_MS);
 *	fake_post(bus, 0, DB_CMD_STOP);
 *	fake_pass(bus, 20 * DB_NS_PER_MS);
 *	assert_int_equal(fake_result(bus), DB_RESULT_OK);
 *	fake_bus_free(bus);
 */
#ifndef DRIVEBRIDGE_FAKES_BUS_H
#define DRIVEBRIDGE_FAKES_BUS_H

#include "fakes/family.h"
#include "fakes/options.h"
#include "sched/engine.h"
#include "sched/queue.h"

#define FAKE_DRIVES 32
#define FAKE_ANSWERS 64
#define FAKE_ANSWER_MAX 256
#define FAKE_BEGIN_TIME (1000 * DB_NS_PER_S) /* when each test begins */

/* On its way to the bridge. */
struct fake_answer {
	db_time at;
	size_t length;
	uint8_t bytes[FAKE_ANSWER_MAX];
};

struct fake_sent {
	db_time at;
	struct fake_frame frame;
};

struct fake_bus {
	struct db_bus_config config;
	struct fake_options options; /* of the bus and of every drive */
	struct db_drive_config drives[FAKE_DRIVES];
	struct db_bus_drive list[FAKE_DRIVES]; /* drives[i], its number i and its axis */
	size_t drive_count;                    /* that were made, on the bus or not */
	struct db_queue *queue;
	struct db_engine *engine;
	db_time now;

	/* The test's own functions, null if it has none. */
	void *context;
	db_time (*next)(void *context); /* latest time for the next call of happen() */
	void (*happen)(void *context);  /* time has passed, and answers were delivered */
	void (*turned)(void *context);  /* the engine was called */
	/*
	 * A request has reached its drive, and `frame` becomes the answer. Returns the time until
	 * the answer arrives; 0: never. Null: drives move and stop as commanded.
	 */
	db_time (*obey)(void *context, struct fake_frame *frame);

	db_time answer_time;        /* from a request to its answer, if obey() is null */
	bool dead[FAKE_DRIVES + 1]; /* by address: receives nothing */
	struct fake_sent *sent;     /* since fake_forget_sent() */
	size_t sent_count;
	size_t sent_size;
	unsigned told[DB_EVENT_COUNT];

	struct fake_answer answers[FAKE_ANSWERS];
	size_t answer_count;
	float speed[FAKE_DRIVES + 1][DB_AXES_MAX]; /* if obey() is null */
	unsigned calls; /* of the engine since counted_from, within a microsecond */
	db_time counted_from;
};

/* Defaults for a bus of this driver and for drives at addresses from 1 on with axes of their
 * own. */
struct fake_bus *fake_bus_new(const struct db_driver *driver, size_t drives);
/* A setting of the family, for the bus or for every drive. */
void fake_option(struct fake_bus *bus, const char *name, double value);
/* Makes the engine, with the first `drives` of them; its port is still down. Without ops drives use
 * frames; the context of ops is the test's own. */
void fake_bus_open(struct fake_bus *bus, size_t drives, const struct db_engine_ops *ops);
void fake_bus_free(struct fake_bus *bus);

/* The port is opened (0), or is lost with an error. */
void fake_port(struct fake_bus *bus, int error);
/* Lets time pass: the engine is called when it asks for it, and must then ask for a later time. */
void fake_pass(struct fake_bus *bus, db_time span);
/* Lets time pass until nothing is under way or due; the next cycle begins in ten seconds. */
void fake_settle(struct fake_bus *bus);
/* For obey(): drives that do not answer. */
db_time fake_answer_nothing(void *context, struct fake_frame *frame);
/* These bytes arrive after this time. On a serial line they replace bytes that have not arrived
 * yet: one conversation at a time. */
void fake_answer_after(struct fake_bus *bus, db_time after, const void *bytes, size_t length);
/* These bytes arrive now. */
void fake_receive(struct fake_bus *bus, const void *bytes, size_t length);

/* Hands a command to list[drive]; with arguments or settings by its request, whose ticket and drive
 * are filled in. */
void fake_post(struct fake_bus *bus, size_t drive, enum db_command command);
void fake_request(struct fake_bus *bus, size_t drive, struct db_request request);
uint32_t fake_ticket(size_t drive, enum db_command command);
/* Copies the next completed request out of the queue; false when there is none. */
bool fake_collect(struct db_queue *queue, struct db_request *ended);
/* The result of the next completed request; NONE when there is none. */
enum db_result fake_result(struct fake_bus *bus);

struct db_snapshot fake_snapshot(const struct fake_bus *bus, size_t drive);
struct db_feedback fake_feedback(const struct fake_bus *bus, size_t drive);
bool fake_is_online(const struct fake_bus *bus, size_t drive);
struct db_bus_stats fake_stats(const struct fake_bus *bus);

/* The number of frames of this kind sent to an address. */
unsigned fake_count(const struct fake_bus *bus, unsigned address, enum fake_kind kind);
void fake_forget_sent(struct fake_bus *bus);

#endif
