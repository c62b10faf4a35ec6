/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Servo drives on CAN: standard frames, id = base + node, values high byte first. Both directions,
 * so that the simulator uses the same code. Pure: no I/O, clock, allocation or global state; any
 * thread. Source: the vendor's CAN protocol for servo drives, of which pages are missing: the user
 * sets their content in struct servo_can_layout.
 */
#ifndef DRIVEBRIDGE_CODEC_SERVO_CAN_H
#define DRIVEBRIDGE_CODEC_SERVO_CAN_H

#include "codec/can.h"
#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SERVO_CAN_BROADCAST 0 /* as a node: all drives; only where servo_can_shapes says so */
#define SERVO_CAN_NODE_MAX 31

/* Ids of the frames of node 0; those of a node are higher by its number. */
enum servo_can_base {
	SERVO_CAN_BASE_ACK = 0x001, /* as printed; see struct servo_can_layout */
	SERVO_CAN_ID_SYNC = 0x01F,  /* the id itself, the same for all nodes */
	SERVO_CAN_BASE_ENABLE = 0x020,
	SERVO_CAN_BASE_MODE = 0x040,
	SERVO_CAN_BASE_SETPOINT = 0x060, /* speed and current */
	SERVO_CAN_BASE_POSITION = 0x080,
	SERVO_CAN_BASE_SET_FEEDBACK = 0x0E0,
	SERVO_CAN_BASE_RAMPS = 0x100,
	SERVO_CAN_BASE_READ = 0x140,
	SERVO_CAN_BASE_ANSWER_POSITION = 0x160, /* answer 1 */
	SERVO_CAN_BASE_ANSWER_MOTION = 0x180,   /* answer 2 */
	SERVO_CAN_BASE_ANSWER_STATUS = 0x1A0,   /* answer 3 */
	SERVO_CAN_BASE_REPORT_POSITION = 0x1C0, /* report 1 */
	SERVO_CAN_BASE_REPORT_MOTION = 0x1E0,   /* report 2 */
	SERVO_CAN_BASE_REPORT_HEALTH = 0x200,   /* report 3 */
	SERVO_CAN_BASE_ANSWER_ANALOGUE = 0x220, /* answer 4 */
};

enum servo_can_error {
	SERVO_CAN_OK = 0,
	SERVO_CAN_ERR_LENGTH = -1, /* fewer data bytes than the frame has; from a host, or more */
	SERVO_CAN_ERR_RANGE = -2,  /* a node, value, code or bit that is not documented */
	SERVO_CAN_ERR_LAYOUT = -3, /* command words: their place is not set, or not possible */
};

enum servo_can_kind {
	SERVO_CAN_FOREIGN, /* no frame of this family, or not one that this side sends */

	/* from the host */
	SERVO_CAN_SYNC,
	SERVO_CAN_ENABLE,
	SERVO_CAN_MODE,
	SERVO_CAN_SPEED,
	SERVO_CAN_CURRENT,
	SERVO_CAN_POSITION, /* internal position command; nothing moves before CTRG rises */
	SERVO_CAN_SET_FEEDBACK,
	SERVO_CAN_RAMPS,
	SERVO_CAN_READ,
	SERVO_CAN_WORDS,  /* command words 0 and 1 */
	SERVO_CAN_WORD_1, /* command word 1, in a frame of its own */
	SERVO_CAN_MOVE,   /* go to a position or by a distance: a direct position frame */

	/* from a drive */
	SERVO_CAN_ACK,
	SERVO_CAN_ANSWER_POSITION,
	SERVO_CAN_ANSWER_MOTION,
	SERVO_CAN_ANSWER_STATUS,
	SERVO_CAN_ANSWER_ANALOGUE,
	SERVO_CAN_REPORT_POSITION,
	SERVO_CAN_REPORT_MOTION,
	SERVO_CAN_REPORT_HEALTH,

	SERVO_CAN_KIND_COUNT
};

/* The ids of acknowledgements of nodes 30 and 31 have another meaning in a host's frame: the
 * sender. */
enum servo_can_side { SERVO_CAN_FROM_HOST, SERVO_CAN_FROM_DRIVE };

/* First byte of an acknowledgement. */
enum servo_can_ack_code {
	SERVO_CAN_ACK_NONE = 0x00, /* not a code: no acknowledgement is documented */
	SERVO_CAN_ACK_ENABLE = 0x01,
	SERVO_CAN_ACK_MODE = 0x02,
	SERVO_CAN_ACK_UNDOCUMENTED_03 = 0x03,
	SERVO_CAN_ACK_SPEED = 0x04,   /* contains the measured speed, not the commanded one */
	SERVO_CAN_ACK_CURRENT = 0x05, /* contains the measured current, not the commanded one */
	SERVO_CAN_ACK_POSITION = 0x06,
	SERVO_CAN_ACK_UNDOCUMENTED_07 = 0x07,
	SERVO_CAN_ACK_UNDOCUMENTED_08 = 0x08,
	SERVO_CAN_ACK_SET_FEEDBACK = 0x09,
	SERVO_CAN_ACK_RAMPS = 0x0A,
	SERVO_CAN_ACK_UNDOCUMENTED_0B = 0x0B,
};

/* The mode word: bits 0..3 are the mode, bit 4 is the direction of torque. */
enum servo_can_mode {
	SERVO_CAN_MODE_POSITION = 0,
	SERVO_CAN_MODE_SPEED = 1,
	SERVO_CAN_MODE_CURRENT = 2,
};
#define SERVO_CAN_MODE_TORQUE_CLOCKWISE (1u << 4) /* positive, seen from the end of the shaft */

enum servo_can_word0_bit {
	SERVO_CAN_CCLR = 1u << 1,   /* clear the position error */
	SERVO_CAN_ZCLAMP = 1u << 2, /* zero speed clamp */
	SERVO_CAN_CTRG = 1u << 3,   /* rising: go to the internal position */
	SERVO_CAN_TRQLM = 1u << 4,  /* limit the torque */
	SERVO_CAN_SPDLM = 1u << 5,  /* limit the speed */
	SERVO_CAN_POS0 = 1u << 6,   /* which internal position */
	SERVO_CAN_POS1 = 1u << 7,
	SERVO_CAN_POS2 = 1u << 8,
};
#define SERVO_CAN_POSITIONS (SERVO_CAN_POS0 | SERVO_CAN_POS1 | SERVO_CAN_POS2)
#define SERVO_CAN_WORD0_DOCUMENTED 0x01FEu

enum servo_can_status_bit {
	SERVO_CAN_ST_STARTED = 1u << 0,
	SERVO_CAN_ST_RUNNING = 1u << 1,
	SERVO_CAN_ST_ZERO_SPEED = 1u << 2,
	SERVO_CAN_ST_SPEED_REACHED = 1u << 3,
	SERVO_CAN_ST_POSITION_REACHED = 1u << 4,
	SERVO_CAN_ST_TORQUE_LIMITED = 1u << 5,
	SERVO_CAN_ST_WARNING = 1u << 6,
	SERVO_CAN_ST_BRAKE_OUTPUT = 1u << 7,
	SERVO_CAN_ST_HOMED = 1u << 8,
	SERVO_CAN_ST_OVERLOAD = 1u << 9,
	SERVO_CAN_ST_ERROR = 1u << 10,
	SERVO_CAN_ST_COMMAND_DONE = 1u << 11,
	SERVO_CAN_ST_STALL_REVERSE = 1u << 12,
	SERVO_CAN_ST_STALL_FORWARD = 1u << 13,
	SERVO_CAN_ST_REVERSE = 1u << 14,
	SERVO_CAN_ST_FORWARD = 1u << 15,
};

/* The bits of the status word, ascending, for people. */
#define SERVO_CAN_STATUS_BITS 16
extern const struct db_drive_bit servo_can_status_bits[SERVO_CAN_STATUS_BITS];

#define SERVO_CAN_FAULTS 16
extern const struct db_drive_fault servo_can_faults[SERVO_CAN_FAULTS];

enum servo_can_fault_bit {
	SERVO_CAN_FAULT_UNDERVOLTAGE = 1u << 0,
	SERVO_CAN_FAULT_POSITION = 1u << 1,
	SERVO_CAN_FAULT_HALL = 1u << 2,
	SERVO_CAN_FAULT_OVERCURRENT = 1u << 3,
	SERVO_CAN_FAULT_OVERLOAD = 1u << 4,
	SERVO_CAN_FAULT_EEPROM = 1u << 5,
	SERVO_CAN_FAULT_IGBT = 1u << 6,
	SERVO_CAN_FAULT_DRIVE_HOT = 1u << 7,
	SERVO_CAN_FAULT_PHASE = 1u << 8,
	SERVO_CAN_FAULT_CURRENT_ERROR = 1u << 9,
	SERVO_CAN_FAULT_SPEED_ERROR = 1u << 10,
	SERVO_CAN_FAULT_MOTOR_HOT = 1u << 11,
	SERVO_CAN_FAULT_OVERVOLTAGE = 1u << 12,
	SERVO_CAN_FAULT_ABSOLUTE_ENCODER = 1u << 13,
	SERVO_CAN_FAULT_LOCKED = 1u << 15, /* bit 14 is not documented, but counts as a fault */
};

/* The answers to a read, as bits; see servo_can_answers. */
enum servo_can_answer {
	SERVO_CAN_GIVES_POSITION = 1u << 0,
	SERVO_CAN_GIVES_MOTION = 1u << 1,
	SERVO_CAN_GIVES_STATUS = 1u << 2,
	SERVO_CAN_GIVES_ANALOGUE = 1u << 3,
};
#define SERVO_CAN_SELECTOR_MAX 7

#define SERVO_CAN_NO_WORD 0xFFu

/* The frame with the command words. The user defines all of it: no page shows it. */
struct servo_can_words_layout {
	bool set; /* false: the rest is not used, and there are no command words */
	/* The id is base + node; base alone is broadcast. The id of speed and current is possible
	 * when fixed[0] distinguishes the frame from theirs. */
	uint16_t base;
	uint8_t length; /* data bytes, 2..8 */
	uint8_t word0;  /* the byte where word 0 starts, high byte first */
	uint8_t word1;  /* as word0; SERVO_CAN_NO_WORD when word 1 is not in this frame */
	/* code that acknowledges it, used by no other frame; SERVO_CAN_ACK_NONE: none */
	uint8_t ack;
	uint8_t fixed[DB_CAN_DATA_MAX]; /* the bytes that belong to neither word */
};

/* A frame with one number, also defined by the user. */
struct servo_can_number_layout {
	bool set;
	uint16_t base;
	uint8_t length;
	uint8_t at;                     /* the byte where the number starts */
	uint8_t size;                   /* its bytes, 2..8; two's complement */
	bool low_first;                 /* low byte first */
	uint8_t ack;                    /* as in servo_can_words_layout */
	uint8_t fixed[DB_CAN_DATA_MAX]; /* the bytes that are not the number's */
};

#define SERVO_CAN_SLOT_MAX 7

/* What the document leaves open, the same for all drives of a bus. */
struct servo_can_layout {
	uint16_t ack_base; /* SERVO_CAN_BASE_ACK unless the user sets another one */
	/* all frames but sync and those that the user describes are sent with 8 data bytes */
	bool padded;
	struct servo_can_words_layout words;
	/* Command word 1, two bytes high byte first, where it has its own frame; words.word1 is
	 * SERVO_CAN_NO_WORD then. */
	struct servo_can_number_layout word1;
	struct servo_can_number_layout move; /* the direct position frame */
	/* The internal position used by POSITION, 0..7, as POS0..2 select it; and its frame: 0
	 * means the documented one, which is of internal position 0. */
	uint8_t slot;
	uint16_t slot_base;
	uint8_t slot_ack;
};

struct servo_can_ack {
	uint8_t code;  /* enum servo_can_ack_code, or the layout's for command words */
	int16_t value; /* code SPEED: rpm, code CURRENT: 0.1 A; both measured */
	uint8_t extra; /* undocumented codes: number of data bytes after the code, 0..7 ... */
	uint8_t bytes[DB_CAN_DATA_MAX - 1]; /* ... and their raw content */
};

/* One frame. The kind selects the member of the union. Positions are in the drive's counts. */
struct servo_can_message {
	enum servo_can_kind kind;
	uint8_t node; /* 1..31, or SERVO_CAN_BROADCAST; not used by SYNC */
	union {
		uint16_t word1;    /* WORD_1 */
		int64_t target;    /* MOVE: in steps of the frame's own */
		bool enable;       /* ENABLE */
		int16_t speed;     /* SPEED: rpm */
		int16_t current;   /* CURRENT: 0.1 A */
		int32_t position;  /* POSITION, SET_FEEDBACK, ANSWER_POSITION, REPORT_POSITION */
		uint8_t selector;  /* READ: 0..7 */
		uint16_t analogue; /* ANSWER_ANALOGUE: analogue input 1, raw */
		struct servo_can_ack ack;
		struct {
			enum servo_can_mode mode;
			bool torque_clockwise;
			bool has_max_speed;
			uint16_t max_speed; /* rpm; 0 unless has_max_speed */
		} mode;                     /* MODE */
		struct {
			uint32_t acceleration; /* rpm/s */
			uint32_t deceleration; /* rpm/s */
		} ramps;                       /* RAMPS */
		struct {
			uint16_t word0; /* enum servo_can_word0_bit */
			uint16_t word1; /* bits of the full manual; 0 where the frame has none */
		} words;                /* WORDS */
		struct {
			int16_t speed;   /* rpm */
			int16_t current; /* 0.1 A */
		} motion;                /* ANSWER_MOTION, REPORT_MOTION */
		struct {
			uint16_t bits; /* enum servo_can_status_bit */
			uint8_t inputs;
			uint8_t outputs;
		} status; /* ANSWER_STATUS */
		struct {
			uint16_t voltage;     /* raw: no scale is documented */
			uint16_t temperature; /* raw: no scale and no sign is documented */
			uint16_t faults;      /* enum servo_can_fault_bit */
		} health;                     /* REPORT_HEALTH */
	} u;
};

/*
 * Writes the frame of a message of either side. Refused, with the frame left as it was: a node
 * above 31, or 0 where there is no broadcast; FOREIGN; a mode, selector or bit of a command word
 * that is not documented; a value that the frame would not carry; command words without a layout.
 * The bits of status and faults are the drive's own and pass as they are.
 */
enum servo_can_error servo_can_encode(const struct servo_can_message *message,
                                      const struct servo_can_layout *layout,
                                      struct db_can_frame *frame);

/*
 * Tells what a frame from that side is. SERVO_CAN_OK with kind FOREIGN when it is none of this
 * family's: an extended, remote or error frame, an id no documented frame of that side has, or one
 * of the missing pages. An error when the id is ours and the rest is wrong: kind and node are then
 * set, but the union is not to be used, with one exception: in an ACK with SERVO_CAN_ERR_RANGE the
 * code is right, and is one that neither the document nor the layout has. On the id that SPEED and
 * CURRENT share the kind is SPEED when the length is wrong, and FOREIGN when byte 0 is of neither.
 * Where frames of the layout share an id, byte 0 tells which it is. Bytes that a drive's frame has
 * beyond those documented are ignored, whether frames are padded or not, and so is a maximum speed
 * in a MODE frame that says it has none.
 */
enum servo_can_error servo_can_decode(const struct db_can_frame *frame,
                                      const struct servo_can_layout *layout,
                                      enum servo_can_side from, struct servo_can_message *message);

/*
 * The code a node acknowledges this message of the host with. SERVO_CAN_ACK_NONE for SYNC and READ,
 * for command words without a layout, and for a broadcast: whether that is acknowledged is not
 * documented, so it cannot be awaited.
 */
uint8_t servo_can_ack_expected(const struct servo_can_message *message,
                               const struct servo_can_layout *layout);

/* The answers to a read, as bits of enum servo_can_answer; 0 for a selector above 7. */
unsigned servo_can_answers(uint8_t selector);

/* The selector with exactly these answers (enum servo_can_answer), or -1: not all sets have one. */
int servo_can_selector(unsigned answers);

/* Short lower-case name of a bit 0..15 of word 0; NULL when it is not documented, as none of word 1
 * is. */
const char *servo_can_word0_name(unsigned bit);

/* "position", "speed" or "current"; NULL for any other. */
const char *servo_can_mode_name(unsigned mode);

#endif
