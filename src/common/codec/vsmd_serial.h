/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD over RS232 and RS485: an ASCII line out, a binary frame back. Both directions, so that the
 * simulator uses the same code. Pure: no I/O, clock, allocation or global state; any thread.
 * Source: VSMD custom protocol for RS232 & RS485, sections 1.2, 2, 3 and appendices 1 and 2.
 */
#ifndef DRIVEBRIDGE_CODEC_VSMD_SERIAL_H
#define DRIVEBRIDGE_CODEC_VSMD_SERIAL_H

#include "codec/vsmd.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define VSMD_SERIAL_LINE_MAX 1536  /* "cfg" with all parameters written at once, and room */
#define VSMD_SERIAL_FRAME_MAX 8192 /* five times the text of all parameters that are known */
#define VSMD_SERIAL_STATUS_FRAME 21
#define VSMD_SERIAL_BROADCAST 0
#define VSMD_SERIAL_NO_ID (-1) /* RS232: the line carries no id */
#define VSMD_SERIAL_ID_MAX 32

enum vsmd_verb {
	VSMD_DEV,
	VSMD_STS,
	VSMD_ENA,
	VSMD_OFF,
	VSMD_MOV, /* velocity used when has_velocity */
	VSMD_POS, /* position; velocity when has_velocity */
	VSMD_RMV, /* position is the distance; velocity when has_velocity */
	VSMD_STP, /* value 0 or 1 when has_value */
	VSMD_ORG, /* position when has_value */
	VSMD_ECLR,
	VSMD_SENSOR_OUT, /* s1..s6: port 1..6, value 0 off, 1 on */
	VSMD_SV,         /* sv1..3: port 1..3, value 0..255 */
	VSMD_NMOS,       /* nmos1..3: port 1..3, value 0..255 */
	VSMD_ZERO_START,
	VSMD_ZERO_STOP,
	VSMD_SHAKE_CYCLES, /* shake start ... cycles= */
	VSMD_SHAKE_TIME,   /* shake start ... time= */
	VSMD_SHAKE_STOP,
	VSMD_CFG_READ,
	VSMD_CFG_WRITE, /* settings[0..setting_count) */
	VSMD_SAV,
	VSMD_VERB_COUNT
};

struct vsmd_setting {
	enum vsmd_param param;
	union db_value value; /* of the parameter's type */
};

struct vsmd_command {
	enum vsmd_verb verb;
	int id; /* 1..32, VSMD_SERIAL_BROADCAST or VSMD_SERIAL_NO_ID */
	bool has_value;
	bool has_velocity;
	int32_t position;
	float velocity;
	uint8_t port;
	uint8_t value;
	int32_t shake_start;
	int32_t shake_end;
	float shake_frequency;
	uint32_t shake_count; /* cycles, or seconds; 0 = no limit; at most INT32_MAX */
	const struct vsmd_setting *settings;
	size_t setting_count;
};

enum vsmd_error {
	VSMD_OK = 0,
	VSMD_ERR_SYNTAX = -1, /* no such verb, word or form */
	VSMD_ERR_RANGE = -2,  /* well formed, outside the documented range */
	VSMD_ERR_NAME = -3,   /* a parameter no document names */
	VSMD_ERR_SPACE = -4,  /* does not fit the buffer */
};

/*
 * Host to drive. Writes the line with its '\n' (not terminated) and returns its length, or a
 * negative vsmd_error; out-of-range values are refused here, never put on the wire. Floats are
 * written in the shortest plain decimal form that reads back as the same float, no exponent.
 */
int vsmd_serial_encode_command(const struct vsmd_command *command, char *line, size_t size);

/*
 * Drive's side: one line without its '\n'. With `rs485` the first word must be an id 0..32. The
 * settings of a cfg write go to settings[0..capacity) and the command points there. On
 * VSMD_ERR_RANGE, _NAME and _SYNTAX, command->id is set whenever it could be read (else -2), so
 * that a drive can answer cmd_wrg.
 */
enum vsmd_error vsmd_serial_decode_command(const char *line, size_t length, bool rs485,
                                           struct vsmd_command *command,
                                           struct vsmd_setting *settings, size_t capacity);

struct vsmd_status {
	float velocity;   /* pulses per second */
	int32_t position; /* pulses */
	uint32_t status;  /* enum vsmd_status_bit */
};

/*
 * Walks the "name=value name=value" text of a PARAMS reply; commas may stand between the pairs,
 * too, and names may be in capitals. Start with *cursor = 0. Returns 1 and fills *setting for a
 * known name whose value can be read and fits the parameter's type (its range is not checked: the
 * drive is the authority on what it holds), 2 for an unknown name or a value that cannot be read
 * (skipped), 0 at the end.
 */
int vsmd_serial_next_param(const char *text, size_t length, size_t *cursor,
                           struct vsmd_setting *setting);

/* Drive's side: all parameters as text, in the shape real drives send. Length or VSMD_ERR_SPACE. */
int vsmd_serial_format_params(const union db_value values[VSMD_PARAM_COUNT], char *text,
                              size_t size);

#endif
