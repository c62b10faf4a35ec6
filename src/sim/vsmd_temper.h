/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the documents of VSMD drives leave open: a drive's behaviour in these points. All zeros is
 * the drive that the documents suggest. Pure data and functions; any thread.
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
	SIM_HANDSHAKE_DEV,    /* a request for its identity: `dev`, on CAN reading the identity */
	SIM_HANDSHAKE_ANY,    /* any message of the host */
};

/* How long a refusal is shown. */
enum sim_refusal {
	SIM_REFUSAL_OF_BUS,  /* serial: UNREAD, CAN: KEPT */
	SIM_REFUSAL_KEPT,    /* until the next command; a read is none */
	SIM_REFUSAL_ONCE,    /* reporting the status clears it */
	SIM_REFUSAL_CLEARED, /* a read counts as a command: it clears it before the answer */
};

enum sim_speed { SIM_SPEED_SIGNED, SIM_SPEED_UNSIGNED, SIM_SPEED_NONE };
enum sim_text_ends { SIM_TEXT_PLAIN, SIM_TEXT_NUL, SIM_TEXT_CRLF, SIM_TEXT_QUOTED };
enum sim_numbers { SIM_NUMBERS_PLAIN, SIM_NUMBERS_EXPONENT, SIM_NUMBERS_QUOTED };
/* A serial drive's answer to a request for its parameters. */
enum sim_parameters { SIM_PARAMETERS_TOLD, SIM_PARAMETERS_REFUSED, SIM_PARAMETERS_SILENT };

enum sim_answers { SIM_ANSWERS_PAIRS, SIM_ANSWERS_PADDED, SIM_ANSWERS_SINGLES };
/* The addressee of answers, on CAN. */
enum sim_replies {
	SIM_REPLIES_HOST,
	SIM_REPLIES_HOST_0,
	SIM_REPLIES_BROADCAST,
	SIM_REPLIES_STANDARD
};

#define SIM_VSMD_TEXT_MAX 8000 /* characters */

/* Registers that are never answered, both included. */
struct sim_registers {
	uint8_t first;
	uint8_t last;
};

struct sim_vsmd_temper {
	enum sim_handshake handshake;
	bool keeps_handshake;     /* over a power cycle */
	db_time handshake_lapses; /* after this time without an event that sets it; 0: never */
	db_time power_delay;      /* delay of the pwr bit */
	db_time standing_delay;   /* delay of the stp bit */
	db_time motion_delay;     /* from a command to the begin of its motion */
	enum sim_refusal refusal;
	bool clamps;            /* values out of range become the nearest one, without an error */
	int32_t rests_off;      /* offset of the counter at standstill */
	int32_t trembles;       /* ... and an additional offset in every second report */
	enum sim_speed speed;   /* in its status */
	bool mirrored;          /* it counts in the direction opposite to its command */
	bool keeps_position;    /* without power of the motor, and without its own */
	bool coasts;            /* a stop removes the motor's power */
	bool keeps_zero;        /* the homing bit is cleared when homing begins, and not before */
	bool ignores_broadcast; /* it ignores messages to all drives */
	enum sim_settles settles;
	bool hides_outputs;      /* the status word does not show the levels of output ports */
	enum sim_text_ends text; /* of identity and parameters on serial lines */
	enum sim_numbers numbers;
	enum sim_parameters parameters;
	bool capitals; /* for names of parameters */
	bool commas;   /* between them */
	/* minimum length of the parameters' text: unknown names follow the others */
	size_t text_length;
	struct sim_registers lacks[SIM_VSMD_LACKS_MAX]; /* data registers, on CAN */
	size_t lacks_count;
	enum sim_answers answers; /* how registers are put into frames, on CAN */
	enum sim_replies replies;
	unsigned read_max;   /* most registers reported at once; 0: as many as requested */
	bool hides_identity; /* its identity's registers are not answered, on CAN */
};

/* True if a read of these registers is answered. */
bool sim_vsmd_has_registers(const struct sim_vsmd_temper *temper, unsigned first, unsigned count);

/* Reads "1c-2b" or "0b" (hexadecimal). */
bool sim_registers_parse(const char *text, struct sim_registers *registers);

/* The text in this drive's form: its ends, and the format of numbers. Length, or -1: no room. */
int sim_vsmd_dress_text(const struct sim_vsmd_temper *temper, const char *text, size_t length,
                        char *out, size_t size);

struct sim_vsmd;
struct vsmd_status;

/* The status as reported to the host: bits may change late, and reporting may clear some. `read`:
 * requested by a read that is no command (on CAN). */
void sim_vsmd_report_status(struct sim_vsmd *drive, bool read, db_time now,
                            struct vsmd_status *status);

#endif
