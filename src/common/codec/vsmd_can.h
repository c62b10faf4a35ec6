/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD over CAN: commands, registers and their answers as CAN frames. Both directions, so that the
 * simulator uses the same code. Pure: no I/O, clock, allocation or global state; any thread.
 * Source: VSMD CAN 2.0 protocol, sections 1.2 to 1.6, 2, 3, 4 and 5.2.
 *
 * The host sends commands and data writes; drives answer reads and nothing else. Values travel high
 * byte first. Functions that build something leave it untouched when they return an error.
 */
#ifndef DRIVEBRIDGE_CODEC_VSMD_CAN_H
#define DRIVEBRIDGE_CODEC_VSMD_CAN_H

#include "codec/can.h"
#include "codec/vsmd_can_registers.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define VSMD_CAN_BROADCAST 0 /* as a drive: all drives */
#define VSMD_CAN_STD_DRIVE_MAX 15
#define VSMD_CAN_SOURCE_MAX 511 /* extended frames: a host is 0..511; standard ones do not say */
#define VSMD_CAN_FRAME_REGS 2   /* number of registers that fit into a frame */

/* --- ids -------------------------------------------------------------------------------------- */

enum vsmd_can_control {
	VSMD_CAN_STATUS_REPLY, /* from a drive: status registers */
	VSMD_CAN_DATA_REPLY,   /* from a drive: data registers */
	VSMD_CAN_DATA_WRITE,   /* from the host */
	VSMD_CAN_COMMAND,      /* from the host */
};

/*
 * Extended frames contain both sides: the receiver is `target`, the sender `source`. Standard
 * frames have one field, which is taken to hold the drive in both directions: drives' answers in
 * standard frames are not documented. So a standard reply has the drive in `source`, 0 in `target`.
 */
struct vsmd_can_id {
	bool extended;
	bool broadcast; /* then target is 0 */
	enum vsmd_can_control control;
	uint16_t target;
	uint16_t source;
	uint8_t reg; /* register, or the code of a command */
};

/* The id with DB_CAN_EXTENDED where it applies. VSMD_ERR_RANGE: a field is outside its limits. */
enum vsmd_error vsmd_can_pack_id(const struct vsmd_can_id *id, uint32_t *packed);

/*
 * VSMD_ERR_SYNTAX: a remote or error frame, a bit set that is always 0, or sides that cannot be.
 * What was accepted packs into the same id again, but for the target of an extended broadcast: it
 * is read whatever it is, since the document leaves it open, and written as 0.
 */
enum vsmd_error vsmd_can_unpack_id(uint32_t packed, struct vsmd_can_id *id);

/* --- commands --------------------------------------------------------------------------------- */

/* The codes are those on the wire. */
enum vsmd_can_code {
	VSMD_CAN_ENA = 0x01,
	VSMD_CAN_OFF = 0x02,
	VSMD_CAN_ORG = 0x03, /* position when has_position, else 0 is meant */
	VSMD_CAN_STP = 0x04, /* value 0 decelerate, 1 at once */
	VSMD_CAN_MOV = 0x05, /* velocity when has_velocity */
	VSMD_CAN_POS = 0x06, /* position; velocity when has_velocity */
	VSMD_CAN_SAV = 0x07,
	VSMD_CAN_OUTPUT = 0x08, /* port 1..6, value 0 low, 1 high */
	VSMD_CAN_ZERO_START = 0x09,
	VSMD_CAN_ZERO_STOP = 0x0A,
	VSMD_CAN_RMV = 0x0B,          /* position is the distance; velocity when has_velocity */
	VSMD_CAN_SV = 0x0D,           /* port 1..3, value 0..255 */
	VSMD_CAN_NMOS = 0x0E,         /* port 1..3, value 0..255 */
	VSMD_CAN_AUTO_RES_STS = 0x0F, /* report; interval when has_interval */
	VSMD_CAN_SHAKE = 0x1B,        /* shake, and what it asks for */
	VSMD_CAN_ENCODER = 0x1D,      /* clears the encoder error */
	VSMD_CAN_READ_STATUS = 0x1E,  /* first, count */
	VSMD_CAN_READ_DATA = 0x1F,    /* first, count */
};

/* A shake takes four frames: start, end and frequency, then one of the two that start it. */
enum vsmd_can_shake {
	VSMD_CAN_SHAKE_STOP = 0x00,
	VSMD_CAN_SHAKE_CYCLES = 0x01,    /* shake_count cycles, 0 = no limit */
	VSMD_CAN_SHAKE_TIME = 0x02,      /* shake_count seconds, 0 = no limit */
	VSMD_CAN_SHAKE_START_AT = 0x10,  /* position */
	VSMD_CAN_SHAKE_END_AT = 0x11,    /* position */
	VSMD_CAN_SHAKE_FREQUENCY = 0x12, /* shake_frequency */
};

/* The status registers that a drive sends by itself. */
enum vsmd_can_report {
	VSMD_CAN_REPORT_NONE,
	VSMD_CAN_REPORT_ALL,             /* speed, position, status */
	VSMD_CAN_REPORT_POSITION_STATUS, /* position, status */
	VSMD_CAN_REPORT_POSITION,
};

#define VSMD_CAN_INTERVAL_DEFAULT 50 /* ms between reports when never set */
#define VSMD_CAN_READ_MAX 64         /* registers read at once, so that an answer has a bound */

struct vsmd_can_command {
	enum vsmd_can_code code;
	bool has_position;
	bool has_velocity;
	bool has_interval;
	int32_t position; /* pulses */
	float velocity; /* pulses/s, -VSMD_SPEED_MAX..VSMD_SPEED_MAX; pos and rmv ignore the sign */
	uint8_t port;   /* counted from 1, whatever the wire does */
	uint8_t value;
	enum vsmd_can_shake shake;
	float shake_frequency; /* Hz, VSMD_SHAKE_FREQ_MIN_CAN..VSMD_SHAKE_FREQ_MAX */
	uint32_t shake_count;  /* at most INT32_MAX */
	enum vsmd_can_report report;
	uint16_t interval; /* ms */
	uint8_t first;     /* register */
	uint8_t count;     /* registers, 1..VSMD_CAN_READ_MAX */
};

/* The form of frames on a bus; the same for all its drives. */
struct vsmd_can_style {
	bool extended;
	uint16_t host;       /* extended frames: the host's own id, 0..VSMD_CAN_SOURCE_MAX */
	uint8_t output_base; /* number of the first port in `output`: 1, or 0 on older firmware */
};

/*
 * Host to drive (or VSMD_CAN_BROADCAST; reads never are). VSMD_ERR_RANGE: an argument, the drive
 * or a register is out of reach; VSMD_ERR_SYNTAX: no such code or a read of all drives.
 */
enum vsmd_error vsmd_can_encode_command(const struct vsmd_can_style *style, unsigned drive,
                                        const struct vsmd_can_command *command,
                                        struct db_can_frame *frame);

/*
 * Host to drive: one or two registers in a row, raw. A register no document names is refused with
 * VSMD_ERR_NAME, one out of reach or holding a value out of range with VSMD_ERR_RANGE. The values
 * of packed registers are not checked, for most of their content was read from the drive:
 * vsmd_can_insert has checked what was changed.
 */
enum vsmd_error vsmd_can_encode_write(const struct vsmd_can_style *style, unsigned drive,
                                      unsigned first, const uint32_t *values, unsigned count,
                                      struct db_can_frame *frame);

/*
 * Drive to host: registers first..first+count-1, two to a frame. Returns the number of frames, or
 * VSMD_ERR_RANGE or VSMD_ERR_SPACE. `control` is a reply's; `host` is the one that asked.
 */
int vsmd_can_encode_answer(const struct vsmd_can_style *style, unsigned drive,
                           enum vsmd_can_control control, unsigned first, const uint32_t *values,
                           unsigned count, struct db_can_frame *frames, size_t capacity);

struct vsmd_can_message {
	struct vsmd_can_id id;
	struct vsmd_can_command command;      /* control COMMAND */
	unsigned count;                       /* other controls: registers id.reg onwards, 1 or 2 */
	uint32_t values[VSMD_CAN_FRAME_REGS]; /* raw */
};

/*
 * Any frame, on either side. message->id is set whenever vsmd_can_unpack_id takes the id, so that
 * a drive can tell that it was meant. VSMD_ERR_SYNTAX: not a frame of this family, no such
 * command, or not the length it has; VSMD_ERR_RANGE: an argument is out of range. Which registers
 * exist and what they may hold is for the receiver to say. Only style->output_base is looked at.
 */
enum vsmd_error vsmd_can_decode(const struct vsmd_can_style *style,
                                const struct db_can_frame *frame, struct vsmd_can_message *message);

/* Passes the drives' answers to this host, and as little else as a mask can: foreign frames on a
 * busy bus must not cost time. */
struct db_can_filter vsmd_can_answer_filter(const struct vsmd_can_style *style);
/* Pass the drives' answers to any host and in both kinds of frames, because these show why a drive
 * is not understood. Returns the number of filters. */
#define VSMD_CAN_FILTERS 2
size_t vsmd_can_any_answer_filters(struct db_can_filter filters[VSMD_CAN_FILTERS]);

/* The drive that probably sent this, in a form other than this style's: standard frames instead of
 * extended ones, to another host, with the broadcast bit. -1: not known. */
int vsmd_can_suspect(const struct db_can_frame *frame);

/* --- answers of several frames ---------------------------------------------------------------- */

/* How a drive puts registers into the frames of an answer, as bits. Pairs are documented; another
 * form is accepted, too, once the drive has sent a frame that can be nothing else: no unsolicited
 * report has this form. */
enum vsmd_can_form {
	VSMD_CAN_PADDED = 1u << 0,  /* the last of an odd number has eight bytes, too */
	VSMD_CAN_SINGLES = 1u << 1, /* one register per frame */
};

/* Collects the frames of one answer in any order. Filled by vsmd_can_expect. */
struct vsmd_can_answer {
	struct vsmd_can_id id; /* id that the first frame must have */
	unsigned forms;        /* accepted forms; the caller keeps them for the next answer */
	/* two registers were received where pairs have their second: then eight bytes are not
	 * padding */
	bool odd;
	uint8_t count; /* registers */
	uint64_t seen; /* bit n: register first+n */
	uint32_t values[VSMD_CAN_READ_MAX];
};

enum vsmd_can_took {
	VSMD_CAN_FOREIGN,  /* no frame of this answer */
	VSMD_CAN_REPEATED, /* it was received already; the first one counts */
	VSMD_CAN_PART,     /* accepted, others are missing */
	VSMD_CAN_WHOLE,    /* accepted, and all are there: values[0..count) */
};

/* VSMD_ERR_RANGE as for the read that asks for it; VSMD_ERR_SYNTAX: not a reply's control. */
enum vsmd_error vsmd_can_expect(struct vsmd_can_answer *answer, const struct vsmd_can_style *style,
                                unsigned drive, enum vsmd_can_control control, unsigned first,
                                unsigned count);

/*
 * A frame belongs to the answer when sides, control, register and length are those of one of its
 * frames in a form that this drive has. Frames carry no number: those of an earlier, equal read
 * cannot be distinguished.
 */
enum vsmd_can_took vsmd_can_take(struct vsmd_can_answer *answer,
                                 const struct vsmd_can_message *message);

#endif
