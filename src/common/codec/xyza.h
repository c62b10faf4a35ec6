/* SPDX-License-Identifier: Apache-2.0 */
/*
 * XYZA stepper controllers on RS485 and RS232: binary frames that begin with 5A A5. Both
 * directions, so that the simulator uses the same code. Pure: no I/O, clock, allocation or global
 * state; any thread. Source: the vendor's protocol V1.00 of 2016-10-20, sections 1.2 to 6.2.
 *
 * A frame is 5A A5, a mark that determines its length, then the content: order, level (0
 * controller, 1 host, 2 host of the whole system), object (slave number), class, target, four bytes
 * of value in data frames, and the sum of all content before it. Values are little-endian.
 *
 * Left out because no page describes their content: the extension ports (order FB), program upload
 * (marks 0D and 0E) and actions (mark 0F). Frames of these marks are cut by their length and then
 * refused.
 */
#ifndef DRIVEBRIDGE_CODEC_XYZA_H
#define DRIVEBRIDGE_CODEC_XYZA_H

#include "codec/xyza_params.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define XYZA_COMMAND_FRAME 9  /* bytes of a read, a manual or program command, and of an answer */
#define XYZA_DATA_FRAME 13    /* bytes of a write, and of the answer to a read */
#define XYZA_FRAME_MAX 19     /* bytes of the longest frame that is cut */
#define XYZA_OUTPUTS 8        /* P1..P8 can be switched; inputs and outputs 1..16 are read */
#define XYZA_OUTPUTS_SHIFT 16 /* position of the outputs in the value of a read of the ports */
#define XYZA_PROGRAM_STEP_MAX 65535

enum xyza_axis { XYZA_X, XYZA_Y, XYZA_Z, XYZA_A, XYZA_AXIS_COUNT };

enum xyza_error {
	XYZA_OK = 0,
	XYZA_ERR_FORM = -1,     /* header, mark, length or a fixed byte is wrong */
	XYZA_ERR_CHECKSUM = -2, /* the form is right */
	XYZA_ERR_SIDE = -3, /* the level shows that the other side sent it: an echo, for instance */
	XYZA_ERR_UNKNOWN = -4, /* undocumented order, class or target */
	XYZA_ERR_RANGE = -5,   /* outside the documented range */
	XYZA_ERR_SPACE = -6,   /* does not fit the buffer */
};

/* Byte 3 of a frame, and byte 7 of an answer: the order that it answers. */
enum xyza_order {
	XYZA_ORDER_OK = 0xAA,
	XYZA_ORDER_FAILED = 0xAB,
	XYZA_ORDER_FAILED_BB = 0xBB, /* identical in two tables of the document */
	XYZA_ORDER_ONLINE = 0xAC,
	XYZA_ORDER_DATA = 0xF1, /* reads and writes */
	XYZA_ORDER_MANUAL = 0xF3,
	XYZA_ORDER_PROGRAM = 0xF4,
};

/* --- requests --------------------------------------------------------------------------------- */

enum xyza_verb {
	XYZA_VERB_ONLINE, /* is the controller there? */

	XYZA_READ_MAGNITUDE, /* magnitude of an axis's position, pulses */
	XYZA_READ_SIGN,      /* sign of that position: 0 positive, 1 negative */
	XYZA_READ_STANDING,  /* 0 the axis moves, 1 it stands */
	XYZA_READ_PORTS,
	XYZA_READ_ITEM,

	XYZA_WRITE_MAGNITUDE,
	XYZA_WRITE_SIGN,
	XYZA_WRITE_OUTPUT,
	XYZA_WRITE_OUTPUTS, /* P1..P8 all on or all off */
	XYZA_WRITE_ITEM,

	XYZA_MANUAL_QUICK_STOP,
	XYZA_MANUAL_STOP,
	XYZA_MANUAL_JOG, /* until stopped; one axis of a controller at a time */
	XYZA_MANUAL_CLEAR,

	XYZA_PROGRAM_QUICK_STOP,
	XYZA_PROGRAM_STOP, /* pauses: then it can be continued or ended */
	XYZA_PROGRAM_START,
	XYZA_PROGRAM_CLEAR, /* as XYZA_MANUAL_CLEAR */
	XYZA_PROGRAM_DELAY, /* delay between a start and the program's begin */
	XYZA_PROGRAM_CONTINUE,
	XYZA_PROGRAM_END,
	XYZA_PROGRAM_STEP_ON, /* single step and debugging */
	XYZA_PROGRAM_STEP_OFF,
	XYZA_PROGRAM_STATE,

	XYZA_VERB_COUNT
};

/* Members that a verb does not use are ignored when encoding and 0 after decoding. */
struct xyza_request {
	enum xyza_verb verb : 8;
	enum xyza_axis axis : 8; /* MAGNITUDE, SIGN, STANDING, JOG, CLEAR and items of axes */
	enum xyza_item item : 8; /* READ_ITEM, WRITE_ITEM */
	uint8_t object;          /* slave number, 1..255 */
	uint8_t order;           /* decoded only: enum xyza_order, or any other value */
	bool negative;           /* WRITE_SIGN, JOG */
	bool on;                 /* WRITE_OUTPUT, WRITE_OUTPUTS */
	uint8_t number;          /* WRITE_OUTPUT: port 1..8; START: program; DELAY: seconds */
	uint32_t value; /* WRITE_MAGNITUDE: pulses; WRITE_ITEM: content, see xyza_param_put() */
	/* WRITE_ITEM, encoding only: bits of it that were read, see xyza_item_in_range() */
	uint32_t kept;
};

/*
 * Host to controller. Writes the frame and returns its length, or a negative xyza_error: values
 * outside the documented range are refused here, never sent. Items that can only be written
 * (factory reset, slave number) cannot be read.
 */
int xyza_encode_request(const struct xyza_request *request, uint8_t *frame, size_t size);

/*
 * Controller's side: one whole frame. Whenever the form is right (any error but FORM), object and
 * order are set, so that a controller can answer that it failed.
 */
enum xyza_error xyza_decode_request(const uint8_t *frame, size_t length,
                                    struct xyza_request *request);

/* --- what the document does not have ---------------------------------------------------------- */

/* --- replies ---------------------------------------------------------------------------------- */

enum xyza_reply_kind {
	XYZA_REPLY_DONE,   /* AA */
	XYZA_REPLY_FAILED, /* AB or BB: the controller did not accept the request */
	XYZA_REPLY_DATA,   /* a read's content */
	XYZA_REPLY_PROGRAM_STATE,
};

enum xyza_program_state {
	XYZA_PROGRAM_IDLE = 0,
	XYZA_PROGRAM_RUNNING = 1,
	XYZA_PROGRAM_WAITING = 2,     /* stopped, or before the next single step */
	XYZA_PROGRAM_INTERRUPTED = 3, /* by an emergency stop */
	/* 4 and 5 exist and are not explained; any other byte may occur, too */
};

struct xyza_reply {
	enum xyza_reply_kind kind;
	uint8_t object;
	uint8_t order;      /* DONE, FAILED: the request's order */
	uint8_t item_class; /* DATA: E1..E5 */
	uint8_t target;     /* DATA: as the controller echoed it */
	uint32_t value;     /* DATA: the four bytes */
	uint8_t state;      /* PROGRAM_STATE: enum xyza_program_state, or any other byte */
	uint8_t program;    /* PROGRAM_STATE */
	uint16_t step;      /* PROGRAM_STATE: the current instruction */
};

/* Alternative forms that the document uses for the same content. */
struct xyza_style {
	bool answer_mark_0a; /* answers with mark 0A instead of 0C */
	bool failure_bb;     /* BB instead of AB */
	bool echo_a4; /* XYZA_READ_STANDING is answered with the target after the one asked */
};

/* Host's side: one whole frame. Answers with mark 0A or 0C, failure as AB or BB. */
enum xyza_error xyza_decode_reply(const uint8_t *frame, size_t length, struct xyza_reply *reply);

/* Controller's side. The frame's length or a negative xyza_error. */
int xyza_encode_reply(const struct xyza_reply *reply, const struct xyza_style *style,
                      uint8_t *frame, size_t size);

/* Fills in a reply of kind DATA to this read; value is its content. */
void xyza_fill_data(const struct xyza_request *request, uint32_t value,
                    const struct xyza_style *style, struct xyza_reply *reply);

/*
 * True if this can be the answer to that request: object, kind, order, class and target fit as far
 * as a right answer has them, and a sign or state is 0 or 1. An answer contains only the order, so
 * a late one fits any later request of the same order with such an answer; a failure fits reads as
 * well.
 */
bool xyza_fits(const struct xyza_request *request, const struct xyza_reply *reply);

/* True if it only reads, and changes nothing. */
bool xyza_is_read(enum xyza_verb verb);

/* True if it ends a motion. */
bool xyza_is_stop(enum xyza_verb verb);

/* Longest frame that answers this request. */
size_t xyza_reply_length(enum xyza_verb verb);

/* Ports of a READ_PORTS reply: bit 0 = K1 or P1. */
uint16_t xyza_inputs(uint32_t value);
uint16_t xyza_outputs(uint32_t value);

/* The signed position; false when it does not fit (no position read can return that). */
bool xyza_position(uint32_t magnitude, bool negative, int32_t *position);

#endif
