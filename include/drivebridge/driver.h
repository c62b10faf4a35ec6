/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The driver contract: one family of drives on one kind of bus. A driver turns jobs (poll, a
 * command, a parameter write ...) into exchanges (one request on the wire and what must come back)
 * and answers into feedback. It never sleeps, does no I/O, reads no clock and allocates nothing;
 * everything runs on the bus thread, except `check` and `check_param`, which are pure.
 *
 * A job is a conversation: begin() writes its first exchange, then answer() or lost() is called for
 * each and either writes the next exchange or ends the job. Between two exchanges of a job the
 * scheduler may run other jobs, of the same drive too (a stop always may).
 *
 * A stop's conversation (stop, quick_stop) ends when the drive has answered it or, where drives do not
 * answer, when its status was read behind it. Whether the drive then stops is for the scheduler to see
 * in feedback(), and to say it again: MOVING and the velocity must be what was read, never what is
 * expected. For disable the driver itself reads that the power is off.
 */
#ifndef DRIVEBRIDGE_DRIVER_H
#define DRIVEBRIDGE_DRIVER_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"
#include "drivebridge/config.h"
#include "drivebridge/transport.h"

#define DB_REQUEST_MAX 1024 /* bytes of the longest request: every parameter written at once */
#define DB_SHORT_REQUEST 64 /* enough for polls, probes, identification and stops */
#define DB_ANSWER_MAX 8192  /* bytes of the longest answer frame */

enum db_job_kind {
	DB_JOB_PROBE, /* is an offline drive there? also gets back in step with one that lost answers */
	DB_JOB_IDENTIFY, /* identity and all parameters */
	DB_JOB_POLL,     /* cyclic process data */
	DB_JOB_COMMAND,
	DB_JOB_SETTINGS, /* write parameters */
};

struct db_job {
	enum db_job_kind kind;
	unsigned
		step; /* the driver's own: what was said last, a row of its table of steps; 0 at begin */
	/* COMMAND and SETTINGS: what was asked. Of a stop only the command holds. */
	const struct db_request *request;
	db_time started;  /* when begin() was called */
	bool out_of_step; /* what was said to the drive last was not answered, or is a probe */
};

/* One request on the wire and what is expected back. */
struct db_exchange {
	uint8_t *request; /* the scheduler's buffer, filled by the driver */
	size_t request_size; /* DB_REQUEST_MAX for COMMAND and SETTINGS, DB_SHORT_REQUEST for the rest */
	size_t request_length;
	size_t answer_length; /* longest expected answer, as wire_time() of transports counts it;
	                         0 = none will come (broadcast) */
	unsigned
		sending; /* set by the scheduler: another number each time anything is sent, so that
	                     frames of an answer can be told from those of the one before */
	bool repeatable; /* sending it again after a lost answer is harmless */
	bool begins; /* a command's: it begins the motion, and begin_all() may say it to all drives;
	                false before each call of the driver */
	bool again; /* a command's: asks once more for what did not show yet, which may go on for seconds,
	               so cyclic status goes before it; false before each call of the driver */
	bool open_ended; /* the document gives the answer no length: while it comes it is waited for, up to
	                    DB_ANSWER_MAX. Serial lines only */
	db_time extra_time; /* beyond the bus's drive latency: a flash write, for instance */
};

enum db_step {
	DB_STEP_SEND,   /* the exchange is to be sent next */
	DB_STEP_DONE,   /* the job ended; the conversation's result says how */
	DB_STEP_MORE,   /* (answer only) a part of the answer; the rest is waited for */
	DB_STEP_IGNORE, /* (answer only) not the answer waited for; keep waiting */
};

/* A frame cut out of a serial stream: *skip bytes of garbage, then *length bytes (0: need more). */
typedef void db_cut_fn(const uint8_t *bytes, size_t available, size_t *skip, size_t *length);

struct db_device; /* the driver's own state of one drive */
struct db_can_filter;
struct db_description; /* codec/description.h */

/* A job at the moment when the driver is to say what follows. The scheduler makes one for each call
 * and keeps what it points to. */
struct db_conversation {
	struct db_device *device;
	struct db_job *job;
	struct db_exchange *exchange; /* what was said last; what follows is written into it */
	const void *reply;            /* the driver's own: what the frame says that has come */
	db_time now;
	enum db_result result; /* the driver's with DB_STEP_DONE: how the job ended */
};

/* What accept() says of a frame. */
enum db_frame {
	DB_FRAME_GOOD,
	DB_FRAME_BAD,     /* form or checksum is wrong */
	DB_FRAME_FOREIGN, /* another family's or another master's */
};

/*
 * An inquiry: what is asked of an address at which no drive need be configured, or be at all. The first
 * three only read, and harm nobody; the others are for setting up a drive that stands.
 */
enum db_inquiry_kind {
	DB_INQUIRY_THERE,    /* is anybody there? */
	DB_INQUIRY_IDENTITY, /* and who? */
	DB_INQUIRY_STANDING, /* does it stand? `value`: the axis of a controller with several */
	DB_INQUIRY_SET_ADDRESS,
	DB_INQUIRY_SET_SPEED, /* of the bus, bit/s */
	DB_INQUIRY_SAVE,
};

struct db_inquiry {
	enum db_inquiry_kind kind;
	unsigned address;
	unsigned value;
};

/* What was said to an inquiry. Zeroed before each. */
struct db_inquired {
	char identity[DB_IDENTITY_MAX + 1]; /* printable; "": the family has none */
	bool tells_standing;                /* the next is known */
	bool stands;
	bool refused;
	uint32_t parts;     /* the driver's own: what came of an answer in several frames ... */
	uint32_t values[8]; /* ... and what was in it */
};

/* What recognise() says of a frame. */
enum db_recognised {
	DB_RECOGNISED_NOTHING, /* it answers something else */
	DB_RECOGNISED_PART,    /* of the answer */
	DB_RECOGNISED_ANSWER,  /* all of it is there */
	DB_RECOGNISED_AGAIN,   /* a part that was there already: a second drive says it, too */
};

/* When a drive that was told its new address or speed goes by it. */
enum db_takes_effect {
	DB_TAKES_EFFECT_NEVER, /* it cannot be told so over its bus */
	DB_TAKES_EFFECT_AT_ONCE,
	DB_TAKES_EFFECT_POWER_UP, /* when it was saved, and the power was off and on */
};

/* A setting of the configuration that only this family has. */
struct db_option {
	const char *section; /* "bus" or "drive" */
	const char *name;
	const char *words;  /* allowed words separated by spaces; "" = a number */
	const char *preset; /* default as written in a file; "" = none, NAN */
	double min;         /* of a number */
	double max;
	bool whole; /* a number without fraction */
	const char *unit;
	const char *description;
};

/* Called for each thing wrong in a configuration. `drive` is null when it is the bus's. `error`:
 * refuse it, else warn. */
typedef void db_complain_fn(void *context, const struct db_drive_config *drive, bool error,
                            const char *format, ...) __attribute__((format(printf, 4, 5)));

#define DB_FILTERS_MAX 16
#define DB_AXES_MAX 4

struct db_driver {
	const char *name;  /* protocol = NAME, and the families column of the register map */
	const char *title; /* for people */
	enum db_medium medium;
	unsigned address_min;
	unsigned address_max;
	unsigned default_baud; /* or bit rate, on CAN */
	unsigned
		axes; /* of one controller: so many drives may share an address, `axis = x` telling them
	                  apart (x, y, z, a); 0 = one drive an address */
	bool vendor_layout; /* may be seen with the register map of the vendor's own Modbus models */
	const struct db_option *options; /* at most DB_OPTIONS_MAX */
	size_t option_count;
	uint64_t commands; /* DB_COMMAND_BIT() of all it can do */
	unsigned measures; /* enum db_measure */
	/* A drive answers a command itself. Where it does not (CAN), its effect is looked for in what is
	 * read behind it, and a drive that has not begun yet looks like one that stands. */
	bool acknowledges;
	unsigned output_count; /* ports of set_output, as coils 0.. */
	const struct db_param *params;
	size_t param_count; /* <= DB_PARAMS_MAX */
	const struct db_drive_bit
		*status_bits; /* of drive_status, ascending; null: none are named */
	size_t status_bit_count;
	const struct db_drive_fault *faults; /* by bit of fault_bits; null: none are named */
	size_t fault_count;
	unsigned param_page;    /* families with the same page share their table and registers */
	int acceleration_param; /* index of the parameter behind `acceleration`, -1 = none */
	int deceleration_param;
	const char *
		scale_unit; /* the unit of counts_per_unit in feedback, which the drive tells once its
	                           parameters were read; null: it never does */
	const char *velocity_unit; /* of velocities; null: counts/s */
	int preset_velocity_param; /* of moves without a velocity, and jogs; -1 = none */

	/* Pure: how many of the drive's position units a second one of its velocity units is; 0 when
	 * that is not known. May be null: 1. */
	double (*velocity_counts)(const struct db_drive_config *drive);

	/* Pure: is this command, with these arguments, inside the documented ranges and possible with
	 * this configuration? OK, UNSUPPORTED or OUT_OF_RANGE. */
	enum db_result (*check)(const struct db_bus_config *bus,
	                        const struct db_drive_config *drive, enum db_command command,
	                        const struct db_args *args);
	enum db_result (*check_param)(const struct db_bus_config *bus, size_t param,
	                              union db_value value);

	/* Pure: the ports of set_output that the drive's parameters make inputs, bit 0 = port 1. May be
	 * null: none. */
	unsigned (*input_ports)(const struct db_nameplate *plate);

	/* The commands that this configuration takes away, as a set. May be null: none. */
	uint64_t (*forbidden)(const struct db_bus_config *bus, const struct db_drive_config *drive);

	/* What only the family knows of a configuration. May be null. */
	void (*check_config)(const struct db_bus_config *bus,
	                     const struct db_drive_config *const *drives, size_t drive_count,
	                     db_complain_fn *complain, void *context);

	/* Longest expected time on the wire, answer and a typical drive latency included. Of a
	 * controller with several axes for one of them; each further one adds axis_time(), which is null
	 * where there is none. */
	db_time (*poll_time)(const struct db_bus_config *bus);
	db_time (*axis_time)(const struct db_bus_config *bus);
	db_time (*command_time)(const struct db_bus_config *bus);

	size_t device_size; /* zeroed memory of this size is given to init */
	/* `first` is null, or the device of the first drive at the same address: it outlives this one,
	 * is asked to poll for both, and its poll updates what feedback() of both tells. */
	void (*init)(struct db_device *device, struct db_device *first,
	             const struct db_bus_config *bus, const struct db_drive_config *drive);

	/* This drive leaves, while others at its address stay: polls no longer update it. It may be
	 * the first one, which goes on to poll for the others. Not while a poll is under way. Null
	 * where each drive has an address of its own. */
	void (*leave)(struct db_device *device);

	/*
	 * Pure. Writes an inquiry; false: the family has none of this kind, or not for this address or
	 * value. recognise() says what a good frame that comes then is to it, and adds to `said`.
	 */
	bool (*inquire)(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
	                struct db_exchange *exchange);
	enum db_recognised (*recognise)(const struct db_bus_config *bus,
	                                const struct db_inquiry *inquiry, const uint8_t *frame,
	                                size_t length, struct db_inquired *said);
	const unsigned *
		speeds; /* bit/s that drives can be set to, the usual ones first; 0 behind the last */
	enum db_takes_effect address_effect;
	enum db_takes_effect speed_effect;
	const char *set_up_elsewhere; /* where one of these is never: a sentence for people */

	/* Which frames of a CAN bus matter; how many of DB_FILTERS_MAX. Null on serial lines. */
	size_t (*filters)(const struct db_bus_config *bus, struct db_can_filter *filters);

	db_cut_fn *cut; /* db_can_cut on CAN */

	/* *address: who sent a good frame, or -1 when the frame does not tell. */
	enum db_frame (*accept)(const struct db_bus_config *bus, const uint8_t *frame,
	                        size_t length, int *address);

	/* Pure. Which part of a drive's process data a good frame tells, so that a second one about the same can be told
	 * from another; 0: none, or drives of this bus may send it unasked. May be null: always 0. */
	uint32_t (*part)(const struct db_bus_config *bus, const uint8_t *frame, size_t length);

	/* Pure, any thread: any frame of this bus in words, one that was sent or one that was received. Its text is
	 * empty when the family does not know it. */
	void (*describe)(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
	                 size_t length, struct db_description *description);

	enum db_step (*begin)(struct db_conversation *talk);
	enum db_step (*answer)(struct db_conversation *talk, const uint8_t *frame, size_t length);
	/* No answer in time, all harmless repeats used up. */
	enum db_step (*lost)(struct db_conversation *talk);

	/* A good frame of this drive that no exchange took: the drive reports by itself. True when it
	 * was used. May be null: never. */
	bool (*report)(struct db_device *device, const uint8_t *frame, size_t length, db_time now);

	/* Whether the drive must be asked in this cycle; null: always. Drives that report need not. */
	bool (*wants_poll)(const struct db_device *device, db_time now);

	/*
	 * The drive is considered gone: forget what may have changed when it comes back. Returns
	 * nothing; feedback() then gives the last values.
	 */
	void (*gone)(struct db_device *device);

	/* What is known now and since when (taken). taken_wall_us and the ONLINE and BUS_UP bits are
	 * the scheduler's part. */
	void (*feedback)(const struct db_device *device, struct db_feedback *feedback);
	const struct db_nameplate *(*nameplate)(const struct db_device *device);

	/* One frame that makes every drive of the bus do this (stop, quick_stop, disable, enable) at
	 * once and unconfirmed. False when the family has none. May be null. */
	bool (*broadcast)(enum db_command command, const struct db_bus_config *bus,
	                  struct db_exchange *exchange);

	/*
	 * A common start of all drives of a bus. begin_all() writes into `all` the frame that says to
	 * every drive what the prepared exchange, which begins a motion, says to this one; false when
	 * there is none. When it was sent instead of the prepared exchanges, begun_by_all() goes on with
	 * each conversation where that looks for the effect: nobody acknowledges the frame, and what
	 * begins a motion is not said again by this job. Both null where the family has no broadcast.
	 */
	bool (*begin_all)(const struct db_device *device, const struct db_exchange *prepared,
	                  struct db_exchange *all);
	enum db_step (*begun_by_all)(struct db_conversation *talk);
};

/* Every family, null-terminated: src/driver/list.c. */
extern const struct db_driver *const db_drivers[];

/* What an error from DB_ERROR_DRIVE_FAULT on means: the codes are the same in all families. Null: none
 * has it. */
const struct db_drive_fault *db_driver_fault(uint16_t error);

/* By name, or null. */
const struct db_driver *db_driver_find(const char *name);

/* Reading all of so many drives at so many addresses once, as poll_time(). */
db_time db_driver_round_time(const struct db_bus_config *bus, size_t addresses, size_t drives);

/* See velocity_counts; 1 where it is not known: then shown units are the drive's own. */
double db_driver_velocity_counts(const struct db_driver *driver,
                                 const struct db_drive_config *drive);

/* What a configured drive can do: DB_COMMAND_BIT() of each. */
uint64_t db_driver_commands(const struct db_bus_config *bus, const struct db_drive_config *drive);

#endif
