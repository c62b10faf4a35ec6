/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An invented family of drives and an invented wire, for tests of what is the same for all
 * families. Each job is one exchange, and both sides use struct fake_frame. A test of handlers
 * takes a copy of fake_family and puts its own into it. Pure, like every driver.
 */
#ifndef DRIVEBRIDGE_FAKES_FAMILY_H
#define DRIVEBRIDGE_FAKES_FAMILY_H

#include "drivebridge/driver.h"

#define FAKE_WIRE_TIME (200 * DB_NS_PER_US) /* of every exchange */
#define FAKE_ANSWER_TIME \
	(500 * DB_NS_PER_US) /* from a request to its answer, unless a test sets another one */
#define FAKE_ALL 0xFF        /* the broadcast address */

enum fake_kind {
	FAKE_PROBE,
	FAKE_IDENTIFY,
	FAKE_POLL,
	FAKE_COMMAND, /* a command that is no stop */
	FAKE_STOP,
	FAKE_DISABLE,
	FAKE_REPORT,  /* sent by a drive unasked */
	FAKE_FOREIGN, /* of another master */
	FAKE_PREPARE, /* of a motion in several steps, for a test to implement */
	FAKE_BEGIN,
	FAKE_LOOK,
	FAKE_INQUIRY, /* of an address, for a test to implement */
	FAKE_KINDS
};

/* A request, and its answer. It has the length of a CAN frame, so that it is cut like one. */
struct fake_frame {
	uint8_t address; /* from 1; FAKE_ALL: every drive; 0: damaged */
	uint8_t kind;    /* enum fake_kind */
	uint8_t axis;
	uint8_t part;  /* of an answer in several frames, from 1 */
	uint8_t parts; /* 0 and 1: the answer is this one frame */
	bool powered;  /* in answers: */
	bool refused;
	uint8_t unused;
	int32_t target; /* in requests */
	float speed;    /* in answers */
};

struct db_device {
	struct db_device *first;             /* the first drive at this address, perhaps this one */
	struct db_device *axes[DB_AXES_MAX]; /* of the first: the drives that its polls update */
	uint8_t address;
	uint8_t axis;
	unsigned poll_exchanges; /* exchanges of a poll */
	unsigned parts;          /* of the answer being received */
	unsigned polls;          /* completed ones: its position */
	unsigned reports;
	float speed;
	bool powered;
	bool identified;
	db_time taken; /* 0: it never answered a poll */
};

/* A serial family that acknowledges, with axes. Its setting poll-exchanges of a bus: exchanges of a
 * poll, 0 as 1. */
extern const struct db_driver fake_family;
extern const struct db_transport fake_wire;

/* The kind of a job's request. */
enum fake_kind fake_kind_of(const struct db_job *job);
/* The conversation continues with this request. */
enum db_step fake_say(struct db_conversation *talk, enum fake_kind kind);
/* The question of a scan to an address; `target` is its kind. */
void fake_write_inquiry(const struct db_inquiry *inquiry, struct db_exchange *exchange);
/* The frame in these bytes. */
struct fake_frame fake_frame_at(const uint8_t *bytes, size_t length);

#endif
