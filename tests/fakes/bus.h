/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A bus in made-up time: the real engine and queue, a configuration to be changed before they are
 * made, axes, and a wire on which answers come when they are due. Unless a test brings ops of its own,
 * its drives speak struct fake_frame. One thread; out of memory, or used wrongly, it aborts.
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
#include "sched/engine.h"
#include "sched/queue.h"

#define FAKE_DRIVES 12
#define FAKE_ANSWERS 64
#define FAKE_ANSWER_MAX 256
#define FAKE_BEGIN_TIME (1000 * DB_NS_PER_S) /* when each story begins */

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
	double options[DB_OPTIONS_MAX]; /* of every drive */
	struct db_drive_config drives[FAKE_DRIVES];
	struct db_bus_drive list[FAKE_DRIVES]; /* drives[i], its number i and its axis */
	size_t drive_count;                    /* that were made, on the bus or not */
	struct db_queue *queue;
	struct db_engine *engine;
	db_time now;

	/* The test's own, null where it has none. */
	void *context;
	db_time (*next)(void *context); /* when happen() is to be called at the latest */
	void (*happen)(void *context);  /* time has passed, and answers were delivered */
	void (*turned)(void *context);  /* the engine was called */
	/*
	 * A request has reached its drive, and `frame` becomes the answer. Returns when it comes,
	 * counted from now; 0: never. Null: drives move and stop as they are told.
	 */
	db_time (*obey)(void *context, struct fake_frame *frame);

	db_time answer_time;        /* from a request to its answer, where obey() is null */
	bool dead[FAKE_DRIVES + 1]; /* by address: hears nothing */
	struct fake_sent *sent;     /* since fake_forget_sent() */
	size_t sent_count;
	size_t sent_size;
	unsigned told[DB_EVENT_COUNT];

	struct fake_answer answers[FAKE_ANSWERS];
	size_t answer_count;
	float speed[FAKE_DRIVES + 1][DB_AXES_MAX]; /* where obey() is null */
	unsigned calls; /* of the engine since counted_from, within a microsecond */
	db_time counted_from;
};

/* Defaults for a bus of this driver and for drives at addresses 1.. with axes of their own. */
struct fake_bus *fake_bus_new(const struct db_driver *driver, size_t drives);
/* The engine, with the first `drives` of them; its port is still down. Without ops drives speak frames;
 * their context is the test's own. */
void fake_bus_open(struct fake_bus *bus, size_t drives, const struct db_engine_ops *ops);
void fake_bus_free(struct fake_bus *bus);

/* The port comes (0), or is lost with an error. */
void fake_port(struct fake_bus *bus, int error);
/* Lets the time pass: the engine is called when it wants to be, and must want to be called later. */
void fake_pass(struct fake_bus *bus, db_time span);
/* These bytes come after so much time. On a serial line in the place of those that have not come yet: one
 * conversation at a time. */
void fake_answer_after(struct fake_bus *bus, db_time after, const void *bytes, size_t length);
/* These bytes come now. */
void fake_receive(struct fake_bus *bus, const void *bytes, size_t length);

/* Hands a command over to list[drive]; with arguments or settings by its request, whose ticket and
 * drive are filled in. */
void fake_post(struct fake_bus *bus, size_t drive, enum db_command command);
void fake_request(struct fake_bus *bus, size_t drive, struct db_request request);
uint32_t fake_ticket(size_t drive, enum db_command command);
/* How one more request ended; NONE when none has. */
enum db_result fake_result(struct fake_bus *bus);

struct db_snapshot fake_snapshot(const struct fake_bus *bus, size_t drive);
struct db_feedback fake_feedback(const struct fake_bus *bus, size_t drive);
bool fake_is_online(const struct fake_bus *bus, size_t drive);
struct db_bus_stats fake_stats(const struct fake_bus *bus);

/* Frames of this kind that were sent to an address. */
unsigned fake_count(const struct fake_bus *bus, unsigned address, enum fake_kind kind);
void fake_forget_sent(struct fake_bus *bus);

#endif
