/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A made-up family of drives and a made-up wire, for tests of what is the same for all families. Each
 * job is one exchange, and both sides speak struct fake_frame. A test takes a copy of fake_family and
 * puts its own handlers into it where it is about them. Pure, like every driver.
 */
#ifndef DRIVEBRIDGE_FAKES_FAMILY_H
#define DRIVEBRIDGE_FAKES_FAMILY_H

#include "drivebridge/driver.h"

#define FAKE_WIRE_TIME (200 * DB_NS_PER_US) /* of every exchange */
#define FAKE_ALL 0xFF                       /* the address of every drive at once */

enum fake_kind {
	FAKE_PROBE,
	FAKE_IDENTIFY,
	FAKE_POLL,
	FAKE_COMMAND, /* what is no stop */
	FAKE_STOP,
	FAKE_DISABLE,
	FAKE_REPORT,  /* a drive's own: never asked for */
	FAKE_FOREIGN, /* of another master */
	FAKE_PREPARE, /* of a motion that is said in steps, which is for a test to do */
	FAKE_BEGIN,
	FAKE_LOOK,
	FAKE_INQUIRY, /* of an address, which is for a test to do */
	FAKE_KINDS
};

/* A request, and its answer. As long as a frame of CAN, so that it is cut like one. */
struct fake_frame {
	uint8_t address; /* 1..; FAKE_ALL: every drive; 0: damaged */
	uint8_t kind;    /* enum fake_kind */
	uint8_t axis;
	uint8_t part;  /* of an answer in several frames, from 1 */
	uint8_t parts; /* 0 and 1: the answer is this one frame */
	bool powered;  /* answers: */
	bool refused;
	uint8_t unused;
	int32_t target; /* requests */
	float speed;    /* answers */
};

struct db_device {
	struct db_device *first;             /* at this address, perhaps itself */
	struct db_device *axes[DB_AXES_MAX]; /* of the first: who is updated by its polls */
	uint8_t address;
	uint8_t axis;
	unsigned poll_exchanges; /* a poll is so many */
	unsigned parts;          /* of the answer that is coming */
	unsigned polls;          /* that ended: its position */
	unsigned reports;
	float speed;
	bool powered;
	bool identified;
	db_time taken; /* 0: it never answered a poll */
	struct db_nameplate plate;
};

/* A serial one that acknowledges, with axes. options[0] of the bus: exchanges of a poll, 0 as 1. */
extern const struct db_driver fake_family;
extern const struct db_transport fake_wire;

/* What a job asks for. */
enum fake_kind fake_kind_of(const struct db_job *job);
/* The conversation goes on with this request. */
enum db_step fake_say(struct db_conversation *talk, enum fake_kind kind);
/* The frame that bytes are. */
struct fake_frame fake_frame_at(const uint8_t *bytes, size_t length);

#endif
