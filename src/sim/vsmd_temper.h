/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the documents of VSMD drives leave open, one way or the other: a drive's temperament. All
 * zeros is the drive that the documents suggest. Pure data and functions; any thread.
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_TEMPER_H
#define DRIVEBRIDGE_SIM_VSMD_TEMPER_H

#include "sim/temper.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SIM_VSMD_LACKS_MAX 8

/* What sets the handshake bit. */
enum sim_handshake {
	SIM_HANDSHAKE_OF_BUS, /* serial: DEV, CAN: ANY */
	SIM_HANDSHAKE_DEV,    /* asking who it is: `dev`, on CAN reading the identity */
	SIM_HANDSHAKE_ANY,    /* whatever the host says */
};

/* How long a refusal is shown. */
enum sim_refusal {
	SIM_REFUSAL_OF_BUS, /* serial: UNREAD, CAN: KEPT */
	SIM_REFUSAL_KEPT,   /* until the next command; reading is none */
	SIM_REFUSAL_ONCE,   /* the status that shows it clears it */
	SIM_REFUSAL_CLEARED, /* a read is a command like others: it clears it before it is answered */
};

enum sim_speed { SIM_SPEED_SIGNED, SIM_SPEED_UNSIGNED, SIM_SPEED_NONE };
enum sim_text_ends { SIM_TEXT_PLAIN, SIM_TEXT_NUL, SIM_TEXT_CRLF, SIM_TEXT_QUOTED };
enum sim_numbers { SIM_NUMBERS_PLAIN, SIM_NUMBERS_EXPONENT, SIM_NUMBERS_QUOTED };
/* What a serial drive does when it is asked for its parameters. */
enum sim_parameters { SIM_PARAMETERS_TOLD, SIM_PARAMETERS_REFUSED, SIM_PARAMETERS_SILENT };

#define SIM_VSMD_TEXT_MAX 8000 /* characters */

/* Registers that are never answered, both included. */
struct sim_registers {
	uint8_t first;
	uint8_t last;
};

struct sim_vsmd_temper {
	enum sim_handshake handshake;
	bool keeps_handshake;     /* over a power cycle */
	db_time handshake_lapses; /* after this long without what sets it; 0 = never */
	db_time power_delay;      /* the pwr bit follows so much later */
	db_time standing_delay;   /* the stp bit */
	db_time motion_delay;     /* a motion begins so long after its command */
	enum sim_refusal refusal;
	bool clamps;          /* values out of range become the nearest one, without a word */
	int32_t rests_off;    /* the counter of a standing drive shows so much more */
	int32_t trembles;     /* ... and every second time that it is told so much more than that */
	enum sim_speed speed; /* in its status */
	bool ignores_broadcast; /* what is said to all drives at once is not for it */
	enum sim_settles settles;
	bool hides_outputs;      /* the status word does not show the levels of output ports */
	enum sim_text_ends text; /* of identity and parameters on serial lines */
	enum sim_numbers numbers;
	enum sim_parameters parameters;
	bool capitals;      /* names of parameters */
	bool commas;        /* between them */
	size_t text_length; /* of parameters at least: names that nobody knows come behind the others */
	struct sim_registers lacks[SIM_VSMD_LACKS_MAX]; /* data registers, on CAN */
	size_t lacks_count;
};

/* Whether a read of these registers is answered. */
bool sim_vsmd_has_registers(const struct sim_vsmd_temper *temper, unsigned first, unsigned count);

/* Reads "1c-2b" or "0b" (hexadecimal). */
bool sim_registers_parse(const char *text, struct sim_registers *registers);

/* The text as this drive sends it: its ends, and how numbers look. Length, or -1: no room. */
int sim_vsmd_dress_text(const struct sim_vsmd_temper *temper, const char *text, size_t length,
                        char *out, size_t size);

#endif
