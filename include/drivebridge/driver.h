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
 * A stop's conversation (stop, quick_stop) ends when the drive has answered it or, where drives do
 * not answer, when its status was read after it. The scheduler judges by feedback() whether the
 * drive then stops, and repeats the stop: MOVING and the velocity must be what was read, never what
 * is expected. For disable the driver itself reads that the power is off.
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
	/* is an offline drive there? also gets back in step with a drive that lost answers */
	DB_JOB_PROBE,
	DB_JOB_IDENTIFY, /* identity and all parameters */
	DB_JOB_POLL,     /* cyclic process data */
	DB_JOB_COMMAND,
	DB_JOB_SETTINGS, /* write parameters */
	DB_JOB_REFRESH,  /* read some of the parameters again, in turn */
};

/*
 * One writer's part of a parameter write. Writes that waited for the same drive are one job: no
 * parameter is in two of them.
 */
struct db_write_part {
	const struct db_request *request;
	/* part of a later writer; more may be added while an exchange with `joins` is in
	 * progress */
	struct db_write_part *next;
	/* Set by the driver: */
	enum db_result result; /* result; PENDING: as the job's */
	bool refused;          /* the drive refused a line with only settings of this part */
	bool taken;            /* the drive acknowledged all of it, and nothing has proved it yet */
};

struct db_job {
	enum db_job_kind kind;
	/* the driver's own: the row of the step sent last in its table of steps; 0 at begin */
	uint16_t step;
	bool out_of_step; /* the last request to the drive was not answered, or is a probe */
	/* COMMAND and SETTINGS: the request. For a stop only the command is valid. */
	const struct db_request *request;
	struct db_write_part *parts; /* SETTINGS: the request's part, and those that joined it */
	db_time started;             /* when begin() was called */
};

/* A request on the wire and its expected answer. */
struct db_exchange {
	uint8_t *request; /* the scheduler's buffer, filled by the driver */
	/* DB_REQUEST_MAX for COMMAND and SETTINGS, DB_SHORT_REQUEST for the rest */
	size_t request_size;
	size_t request_length;
	size_t answer_length; /* longest expected answer, as wire_time() of transports counts it;
	                         0 = none will come (broadcast) */
	/* set by the scheduler: changes each time anything is sent, so that frames of an answer can
	 * be distinguished from those of the one before */
	unsigned sending;
	bool repeatable; /* sending it again after a lost answer is harmless */
	/* for a command: it begins the motion, and begin_all() may send it to all drives; false
	 * before each call of the driver */
	bool begins;
	/* for a command: repeats a question because the effect did not show yet, which may take
	 * seconds, so cyclic status goes first; false before each call of the driver */
	bool again;
	/* for a parameter write: other writers' parts for this drive may join the job now */
	bool joins;
	/* it only proves what the drive has acknowledged: lost() may be called instead of sending
	 * it */
	bool proof;
	/* the document gives no length of the answer: it is awaited while bytes arrive, up to
	 * DB_ANSWER_MAX. Serial lines only */
	bool open_ended;
	/* in addition to the bus's drive latency: a flash write, for instance */
	db_time extra_time;
	/* the answer may also have this address, which the drive is being given; 0: no other */
	unsigned also_from;
};

enum db_step {
	DB_STEP_SEND,   /* the exchange is to be sent next */
	DB_STEP_DONE,   /* the job ended; see the conversation's result */
	DB_STEP_MORE,   /* (answer only) a part of the answer; the rest is awaited */
	DB_STEP_IGNORE, /* (answer only) not the answer waited for; keep waiting */
};

/* What was received of a serial line and is not cut yet. */
struct db_received {
	const uint8_t *bytes;
	size_t available;
	/* the request whose answer is awaited; null: none is, or there may be several (CAN) */
	const uint8_t *question;
	size_t question_length;
	/* time since the last of these bytes, see frame_silence; 0: there may be more */
	db_time silence;
};

struct db_device; /* the driver's own state of one drive */
struct db_can_filter;
struct db_description; /* codec/description.h */

/* A job at the moment when the driver chooses the next step. The scheduler makes one for each call
 * and owns everything that it points to. */
struct db_conversation {
	struct db_device *device;
	struct db_job *job;
	struct db_exchange *exchange; /* the exchange sent last; the next one is written into it */
	const void *reply;            /* the driver's own: the decoded frame */
	db_time now;
	/* COMMAND, SETTINGS: a drive of this line moves, or is being stopped, and its next stop
	 * would wait for this exchange. One that takes longer than two status reads is not sent
	 * now. */
	bool brief;
	/* POLL: set by answer() with DB_STEP_SEND when this answer has changed nothing in
	 * feedback(): it need not be published before the next one. */
	bool unchanged;
	enum db_result result; /* set by the driver with DB_STEP_DONE: the job's result */
};

/* The result of accept(). */
enum db_frame {
	DB_FRAME_GOOD,
	DB_FRAME_BAD,     /* form or checksum is wrong */
	DB_FRAME_FOREIGN, /* another family's or another master's */
};

/*
 * An inquiry: a question to an address where no drive is configured, or where there may be none.
 * The first three only read and are harmless; the others set up a drive that stands.
 */
enum db_inquiry_kind {
	/* Is a drive there, and which one? `value`: number of times each was asked before its first
	 * answer, for families whose drives do not all answer the same question. */
	DB_INQUIRY_THERE,
	DB_INQUIRY_IDENTITY,
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

/* The answer to an inquiry. Zeroed before each. */
struct db_inquired {
	char identity[DB_IDENTITY_MAX + 1]; /* printable; "": the family has none */
	bool tells_standing;                /* the next is known */
	bool stands;
	bool refused;
	uint32_t parts;     /* the driver's own: parts of an answer in several frames ... */
	uint32_t values[8]; /* ... and their content */
};

/* The result of recognise(). */
enum db_recognised {
	DB_RECOGNISED_NOTHING, /* it answers another question */
	DB_RECOGNISED_PART,    /* of the answer */
	DB_RECOGNISED_ANSWER,  /* complete */
	DB_RECOGNISED_AGAIN,   /* a part that was received already: from a second drive */
};

/* When a new address or speed of a drive takes effect. */
enum db_takes_effect {
	DB_TAKES_EFFECT_NEVER, /* it cannot be set over its bus */
	DB_TAKES_EFFECT_AT_ONCE,
	DB_TAKES_EFFECT_POWER_UP, /* after it was saved and the power was switched off and on */
};

/*
 * A setting of the configuration that only this family has. Its value is a member of the family's
 * own struct for buses or for drives (bus_options_size, drive_options_size): a double for a number,
 * NAN when it is not set and has no default; an unsigned for a word, its index among the allowed
 * ones.
 */
struct db_option {
	const char *section; /* "bus" or "drive" */
	const char *name;
	size_t offset;      /* of the member */
	const char *words;  /* allowed words separated by spaces; "" = a number */
	const char *preset; /* default as written in a file; "" = none, NAN */
	double min;         /* of a number */
	double max;
	bool whole; /* a number without fraction */
	const char *unit;
	const char *description;
};

/* Called for each error in a configuration. `drive` is null when it is the bus's. `error`: the
 * configuration is refused, else this is a warning. */
typedef void db_complain_fn(void *context, const struct db_drive_config *drive, bool error,
                            const char *format, ...) __attribute__((format(printf, 4, 5)));

/*
 * What the bus itself sends, whatever its drives do: a sync frame, a heartbeat, the start of all
 * nodes. No answer is awaited. Each goes out when it is due, before everything but stops; one that
 * is late is sent once. What they take of the wire is missing for drives: db_driver_own_part().
 */
struct db_bus_message {
	const char *name;
	/* Pure. From one to the next; DB_TIME_NEVER: once after each opening of the port; 0: not on
	 * this bus. */
	db_time (*period)(const struct db_bus_config *bus);
	/* Pure. Writes the one of this number, counted from 0 since the port was opened, of at most
	 * DB_SHORT_REQUEST bytes. */
	void (*write)(const struct db_bus_config *bus, uint32_t number,
	              struct db_exchange *exchange);
};

#define DB_BUS_MESSAGES_MAX 4
#define DB_FILTERS_MAX 16
#define DB_AXES_MAX 4

struct db_driver {
	const char *name;  /* protocol = NAME, and the families column of the register map */
	const char *title; /* for people */
	enum db_medium medium;
	unsigned address_min;
	unsigned address_max;
	unsigned default_baud; /* or bit rate, on CAN */
	/* axes of one controller: this number of drives may share an address, with different `axis`
	 * (x, y, z, a); 0: one drive per address */
	unsigned axes;
	/* can be presented with the register map of the vendor's own Modbus models */
	bool vendor_layout;
	const struct db_option *options;
	size_t option_count;
	size_t bus_options_size; /* of the structs that `options` of a bus and of a drive point to */
	size_t drive_options_size;
	uint64_t commands; /* DB_COMMAND_BIT() of all supported commands */
	unsigned measures; /* enum db_measure */
	/* True if a drive answers a command itself. If not (CAN), its effect is looked for in
	 * readings after it, and a drive that has not begun yet looks like one that stands. */
	bool acknowledges;
	unsigned output_count; /* ports of set_output, as coils 0.. */
	const struct db_param *params;
	size_t param_count; /* <= DB_PARAMS_MAX, and what its page has registers for */
	const struct db_drive_bit
		*status_bits; /* of drive_status, ascending; null: none are named */
	size_t status_bit_count;
	const struct db_drive_fault
		*faults; /* ascending by `error`; null: it has none of its own */
	size_t fault_count;
	/* where their registers begin (regmap/table.h); families with the same page share their
	 * table and registers */
	unsigned param_page;
	int acceleration_param; /* index of the parameter used for `acceleration`, -1 = none */
	int deceleration_param;
	/* the unit of counts_per_unit in feedback, which the drive reports once its parameters were
	 * read; null: never */
	const char *scale_unit;
	const char *velocity_unit; /* of velocities; null: counts/s */
	int preset_velocity_param; /* parameter for moves without a velocity, and jogs; -1 = none */

	/* Pure: number of the drive's position units per second for a velocity of 1; 0 when not
	 * known. May be null: 1. */
	double (*velocity_counts)(const struct db_drive_config *drive);

	/* Pure: is this command, with these arguments, inside the documented ranges and possible
	 * with this configuration? OK, UNSUPPORTED or OUT_OF_RANGE. Null: always OK. */
	enum db_result (*check)(const struct db_bus_config *bus,
	                        const struct db_drive_config *drive, enum db_command command,
	                        const struct db_args *args);
	/* The same of a parameter's value. Null: what the table of parameters allows. Called by
	 * db_driver_check_param(). */
	enum db_result (*check_param)(const struct db_bus_config *bus, size_t param,
	                              union db_value value);

	/* Pure: what of `measures` drives of this bus do not tell, because of its options. May be
	 * null: nothing. */
	unsigned (*not_measured)(const struct db_bus_config *bus);

	/* Pure: the ports of set_output that the drive's parameters make inputs, bit 0 = port 1.
	 * May be null: none. */
	unsigned (*input_ports)(const struct db_nameplate *plate);

	/* The commands that this configuration forbids, as a set. May be null: none. */
	uint64_t (*forbidden)(const struct db_bus_config *bus, const struct db_drive_config *drive);

	/* Checks of the family for a configuration. May be null. */
	void (*check_config)(const struct db_bus_config *bus,
	                     const struct db_drive_config *const *drives, size_t drive_count,
	                     db_complain_fn *complain, void *context);

	/* Longest expected time on the wire, including the answer and a typical drive latency. For
	 * a controller with several axes the time for one of them; each further one adds
	 * axis_time(), which is null where there is none. */
	db_time (*poll_time)(const struct db_bus_config *bus);
	db_time (*axis_time)(const struct db_bus_config *bus);
	unsigned poll_exchanges; /* exchanges that poll_time() counts; 0 = 1 */
	db_time (*command_time)(const struct db_bus_config *bus);

	size_t device_size; /* zeroed memory of this size is given to init */
	/* `first` is null, or the device of the first drive at the same address: it outlives this
	 * one, polls for both, and its poll updates what feedback() of both returns. */
	void (*init)(struct db_device *device, struct db_device *first,
	             const struct db_bus_config *bus, const struct db_drive_config *drive);

	/* This drive is removed, while others at its address stay: polls no longer update it. It
	 * may be the first one, which continues to poll for the others. Not while a poll is in
	 * progress. Null where each drive has an address of its own. */
	void (*leave)(struct db_device *device);

	/*
	 * Pure. Writes an inquiry; false: the family has none of this kind, or not for this address
	 * or value. recognise() classifies a good frame received afterwards, and adds to `said`.
	 * Both null: no address can be asked.
	 */
	bool (*inquire)(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
	                struct db_exchange *exchange);
	enum db_recognised (*recognise)(const struct db_bus_config *bus,
	                                const struct db_inquiry *inquiry, const uint8_t *frame,
	                                size_t length, struct db_inquired *said);
	/* bit/s that drives can be set to, the usual ones first; 0 after the last. Null: none is
	 * known */
	const unsigned *speeds;
	enum db_takes_effect address_effect;
	enum db_takes_effect speed_effect;
	/* where one of these is NEVER: where it can be set instead, a sentence for users */
	const char *set_up_elsewhere;

	const struct db_bus_message *messages; /* in the order in which they are sent */
	size_t message_count;                  /* <= DB_BUS_MESSAGES_MAX */

	/* Parameter writes that wait for the same drive become one job: common exchanges (a
	 * read-back, say) are sent once. lost() then also returns each part's result of a write
	 * that a stop has cancelled. */
	bool joins_settings;

	/* Interval of DB_JOB_REFRESH on a bus, for any of its drives, with one exchange each; 0:
	 * values that may be changed at a drive are read with its process data, or cannot be
	 * read. */
	db_time refresh_pause;

	/* Pure: true if a parameter reported by the drive is what was written. For families whose
	 * parameter writes may be acknowledged without proof, and that report the values later.
	 * Null elsewhere. */
	bool (*holds)(size_t param, union db_value held, union db_value written);

	/* Which frames of a CAN bus matter; how many of DB_FILTERS_MAX. Null on serial lines. */
	size_t (*filters)(const struct db_bus_config *bus, struct db_can_filter *filters);

	/* Cuts a frame out of what was received: *skip bytes of garbage, then *length bytes (0:
	 * needs more). Null on CAN. */
	void (*cut)(const struct db_received *received, size_t *skip, size_t *length);

	/* For frames whose end only shows by silence: cut() is called with this silence once after
	 * the last byte. A computer sees bytes late and in lumps, so the silence of a document is
	 * too short. Null: there are none. Serial lines only. */
	db_time (*frame_silence)(const struct db_bus_config *bus);

	/* Length of the usual answer, so that the thread need not wake up for parts of it; for
	 * protocols whose frames are found after any garbage. 0: each byte is processed when it
	 * arrives. Serial lines only. */
	size_t usual_answer;

	/* *address: the sender of a good frame, or the probable sender of another; -1 when the
	 * frame does not show it. Null: every frame is good, and shows no sender. */
	enum db_frame (*accept)(const struct db_bus_config *bus, const uint8_t *frame,
	                        size_t length, int *address);

	/* Pure. The part of a drive's process data in a good frame, so that a second frame with the
	 * same part can be recognised; 0: none, or drives of this bus may send it unasked. May be
	 * null: always 0. */
	uint32_t (*part)(const struct db_bus_config *bus, const uint8_t *frame, size_t length);

	/* Pure, any thread: describes any frame of this bus in words, sent or received. The text is
	 * empty when the family does not know it. Null: it knows none. */
	void (*describe)(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
	                 size_t length, struct db_description *description);

	enum db_step (*begin)(struct db_conversation *talk);
	enum db_step (*answer)(struct db_conversation *talk, const uint8_t *frame, size_t length);
	/* No answer in time, after all harmless repeats. */
	enum db_step (*lost)(struct db_conversation *talk);

	/* A good frame of this drive that no exchange took: the drive reports by itself. True when
	 * it was used. May be null: never. */
	bool (*report)(struct db_device *device, const uint8_t *frame, size_t length, db_time now);

	/* True if the drive must be polled in this cycle; null: always. Drives that report need
	 * not. */
	bool (*wants_poll)(const struct db_device *device, db_time now);

	/*
	 * The drive counts as gone: forgets what may have changed when it comes back. feedback()
	 * then returns the last values. Null: it keeps nothing else.
	 */
	void (*gone)(struct db_device *device);

	/* What is known now and since when (taken). The scheduler sets taken_wall_us and the ONLINE
	 * and BUS_UP bits. */
	void (*feedback)(const struct db_device *device, struct db_feedback *feedback);
	/* Of param_count parameters. Null: it has neither parameters nor identity. */
	const struct db_nameplate *(*nameplate)(const struct db_device *device);

	/* A frame that makes every drive of the bus do this (stop, quick_stop, disable, enable) at
	 * once and unconfirmed. False when the family has none. May be null. */
	bool (*broadcast)(enum db_command command, const struct db_bus_config *bus,
	                  struct db_exchange *exchange);

	/* Where exchanges overlap (CAN): the frame of a stop for a drive that owes an answer to
	 * another request, to be sent at once. No answer is awaited; the stop is repeated in the
	 * usual way when the owed answer has arrived or is lost. False: there is none now. May be
	 * null. */
	bool (*interrupt)(struct db_device *device, enum db_command command,
	                  struct db_exchange *exchange);

	/*
	 * Pure. True if a drive at this address that misses the beginning of the request, because
	 * it still switches its line after a reply, could take the rest for one to itself. In doubt
	 * true. Null: never.
	 */
	bool (*mishears)(unsigned address, const uint8_t *request, size_t length);

	/*
	 * A common start of all drives of a bus. begin_all() writes into `all` the frame that sends
	 * to every drive what the prepared exchange, which begins a motion, sends to this one;
	 * false when there is none. After it was sent instead of the prepared exchanges,
	 * begun_by_all() continues each conversation where it looks for the effect: the frame is
	 * not acknowledged, and this job does not send it again. Both null where the family has no
	 * broadcast.
	 */
	bool (*begin_all)(const struct db_device *device, const struct db_exchange *prepared,
	                  struct db_exchange *all);
	enum db_step (*begun_by_all)(struct db_conversation *talk);
};

/* The value of an option as a number, in the struct that has it. */
double db_option_value(const struct db_option *option, const void *options);
void db_option_set(const struct db_option *option, void *options, double value);

/* Every family, null-terminated: src/bridge/driver/list.c. */
extern const struct db_driver *const db_drivers[];

/* The family's own fault of an error from DB_ERROR_DRIVE_FAULT on. Null: it names none. */
const struct db_drive_fault *db_driver_fault(const struct db_driver *driver, uint16_t error);

/* By name, or null. */
const struct db_driver *db_driver_find(const char *name);

/* The part of the wire, from 0 to 0.9, that the bus's own messages take, and what the longest of them
 * takes. */
double db_driver_own_part(const struct db_bus_config *bus);
db_time db_driver_own_time(const struct db_bus_config *bus);

/* Time to read this number of drives at this number of addresses once, as poll_time(), between the
 * bus's own messages. */
db_time db_driver_round_time(const struct db_bus_config *bus, size_t addresses, size_t drives);

/* Twice the time of reading a status: while a drive of a serial line moves, nothing is sent that
 * takes longer. */
db_time db_driver_brief_time(const struct db_bus_config *bus);

/* May a parameter of this bus's drives be written with this value? OK, UNSUPPORTED (there is none of
 * this index, too) or OUT_OF_RANGE. */
enum db_result db_driver_check_param(const struct db_bus_config *bus, size_t param,
                                     union db_value value);

/* See velocity_counts; 1 where it is not known: then the drive's own units are shown. */
double db_driver_velocity_counts(const struct db_driver *driver,
                                 const struct db_drive_config *drive);

/* The commands of a configured drive: DB_COMMAND_BIT() of each. */
uint64_t db_driver_commands(const struct db_bus_config *bus, const struct db_drive_config *drive);

#endif
