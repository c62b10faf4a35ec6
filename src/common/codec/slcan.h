/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The LAWICEL ASCII protocol of serial CAN adapters (slcan): short lines, ended by a carriage
 * return, down to the adapter and up from it. Both directions, so that the simulated adapter uses
 * the same code. Pure: no I/O, clock, allocation or global state; any thread.
 */
#ifndef DRIVEBRIDGE_CODEC_SLCAN_H
#define DRIVEBRIDGE_CODEC_SLCAN_H

#include "codec/can.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SLCAN_LINE_MAX 31 /* T, id, length, eight bytes, a time stamp and the carriage return */
#define SLCAN_TEXT_MAX 16 /* length of a version or serial number; LAWICEL's have four characters */

#define SLCAN_CR '\r'  /* ends every line; alone: done */
#define SLCAN_BEL '\a' /* alone: refused */

/* --- what both sides have in common ----------------------------------------------------------- */

enum slcan_error {
	SLCAN_OK = 0,
	SLCAN_ERR_SYNTAX = -1, /* no such letter or form */
	SLCAN_ERR_RANGE = -2,  /* well formed, but no such id, length or setting */
	SLCAN_ERR_SPACE = -3,  /* does not fit the buffer */
};

/* Digit of S for a bit rate (10, 20, 50, 100, 125, 250, 500, 800 kbit/s, 1 Mbit/s), or -1. */
int slcan_bitrate_digit(uint32_t bitrate);

/* The other way round: bit/s of S0..S8, or 0. */
uint32_t slcan_bitrate(unsigned digit);

/* --- lines ------------------------------------------------------------------------------------ */

/* A line being received. Start with zeros; owned by the caller. */
struct slcan_reader {
	char line[SLCAN_LINE_MAX];
	/* length of `line`, once complete; it ends with SLCAN_CR or is a single SLCAN_BEL */
	uint8_t length;
	bool complete; /* the next byte starts a new line */
	bool spoilt;   /* too long, or with invalid characters: ignored up to its end */
};

enum slcan_took {
	SLCAN_TOOK_MORE,  /* continue */
	SLCAN_TOOK_LINE,  /* reader->line is complete, until the next call */
	SLCAN_TOOK_SPOILT /* an invalid line ended */
};

/* Takes the next byte from the serial line. BEL ends the text before it and is a line itself; line
 * feeds and zeros are ignored. */
enum slcan_took slcan_take(struct slcan_reader *reader, uint8_t byte);

/* --- host to adapter -------------------------------------------------------------------------- */

enum slcan_verb {
	SLCAN_NOTHING,    /* an empty line, to end a line that an adapter may have partly read */
	SLCAN_SET_RATE,   /* S: digit */
	SLCAN_SET_BTR,    /* s: btr */
	SLCAN_OPEN,       /* O */
	SLCAN_LISTEN,     /* L: open, but never send, not even acknowledges */
	SLCAN_CLOSE,      /* C */
	SLCAN_SEND,       /* t T r R: frame */
	SLCAN_VERSION,    /* V */
	SLCAN_SERIAL,     /* N */
	SLCAN_FLAGS,      /* F: asks for the status flags and clears them */
	SLCAN_TIMESTAMPS, /* Z: digit 0 off, 1 on */
	SLCAN_VERB_COUNT
};

struct slcan_command {
	enum slcan_verb verb;
	uint8_t digit;
	uint16_t btr; /* bus timing registers 0 (high byte) and 1 of an SJA1000 */
	struct db_can_frame frame;
};

/* Writes a line with its carriage return, not terminated by a zero. Length or negative error. */
int slcan_encode_command(const struct slcan_command *command, char *line, size_t size);

/* A whole line as returned by slcan_take(). */
enum slcan_error slcan_decode_command(const char *line, size_t length,
                                      struct slcan_command *command);

/* --- adapter to host -------------------------------------------------------------------------- */

enum slcan_reply_kind {
	SLCAN_REPLY_DONE,    /* CR */
	SLCAN_REPLY_REFUSED, /* BEL */
	SLCAN_REPLY_FRAME,   /* t T r R: a frame came; timestamp when has_timestamp */
	SLCAN_REPLY_SENT,    /* z or Z: a frame was taken; `extended` tells which kind */
	SLCAN_REPLY_VERSION, /* V: text */
	SLCAN_REPLY_SERIAL,  /* N: text */
	SLCAN_REPLY_FLAGS,   /* F: flags */
	SLCAN_REPLY_COUNT
};

enum slcan_flag {
	SLCAN_RX_FULL = 1 << 0,
	SLCAN_TX_FULL = 1 << 1,
	SLCAN_ERROR_WARNING = 1 << 2,
	SLCAN_DATA_OVERRUN = 1 << 3,
	SLCAN_ERROR_PASSIVE = 1 << 5,
	SLCAN_ARBITRATION_LOST = 1 << 6,
	SLCAN_BUS_ERROR = 1 << 7,
};

struct slcan_reply {
	enum slcan_reply_kind kind;
	struct db_can_frame frame;
	bool has_timestamp;
	uint16_t timestamp; /* ms; most adapters start again after 59999 */
	bool extended;
	uint8_t flags;                 /* enum slcan_flag */
	char text[SLCAN_TEXT_MAX + 1]; /* printable, terminated */
};

int slcan_encode_reply(const struct slcan_reply *reply, char *line, size_t size);
enum slcan_error slcan_decode_reply(const char *line, size_t length, struct slcan_reply *reply);

#endif
