/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One simulated XYZA controller: up to four axes, inputs, outputs, programs and its memory. It
 * knows requests but no wire: xyza_bus.h converts bytes into struct xyza_request. Time is passed in
 * and must not run backwards (an earlier `now` counts as the latest one). One thread.
 *
 * Where the vendor's document is silent the controller does this: unknown requests and values out
 * of range are answered as failed; manual motion and programs exclude each other, and commands of
 * one mode do not affect the other; a new manual speed holds from the next jog on; parameters are
 * stored at once and survive a loss of power (what cannot be stored is answered as failed),
 * positions, outputs and the delay of programs are not; a program moves x forwards in its odd steps
 * and backwards in its even ones.
 */
#ifndef DRIVEBRIDGE_SIM_XYZA_CONTROLLER_H
#define DRIVEBRIDGE_SIM_XYZA_CONTROLLER_H

#include "codec/xyza.h"
#include "drivebridge/time.h"
#include "sim/temper.h"
#include "sim/xyza_axes.h"
#include "sim/xyza_memory.h"

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

#define SIM_XYZA_INPUTS 16
#define SIM_XYZA_RESET_TIME (10 * DB_NS_PER_S)

/* Kinds of requests that a controller may acknowledge without doing anything. */
enum sim_xyza_kind {
	SIM_XYZA_POSITION, /* amount and sign */
	SIM_XYZA_SIGN,
	SIM_XYZA_ITEM,
	SIM_XYZA_OUTPUT,
	SIM_XYZA_JOG,
	SIM_XYZA_PROGRAM, /* its commands, not its stops */
	SIM_XYZA_KIND_COUNT
};
extern const char *const sim_xyza_kinds[SIM_XYZA_KIND_COUNT + 1]; /* their names; null at the end */

/* What the document leaves open. All zeros is the controller above. */
struct sim_xyza_temper {
	bool no_negative_zero;   /* the sign of a position of 0 is lost */
	bool amount_clears_sign; /* writing the amount of a position makes it positive */
	bool acknowledges_all;   /* requests that are not carried out are also acknowledged */
	/* a bit for each enum sim_xyza_kind that is acknowledged without effect */
	unsigned ignores;
	uint32_t lacks;           /* a bit for each item that is never answered */
	bool lacks_ports;         /* the ports are never answered */
	bool lacks_program;       /* the program's state is never answered */
	uint8_t idle_state;       /* the reported state of an idle program */
	bool clamps;              /* speeds above SIM_XYZA_SPEED_MAX become that */
	enum sim_settles settles; /* its number; the manual has no power-up */
	bool jogs_from_stand;     /* an axis that moves accepts no jog */
	bool second_stop_ends;    /* a second stop ends a waiting program */
	bool latches_speed;       /* a moving axis keeps the speed with which it began */
	bool takes_any;           /* items may have values that the document does not name */
	bool ordered_speeds;      /* min_speed is never above max_speed */
	db_time motion_delay;     /* delay of a jog */
	db_time standing_delay;   /* delay of the state of the motors */
	db_time item_delay;       /* delay of the values read of items */
	db_time braking;          /* from max_speed; 0: the same as its acceleration */
	bool answers_as_host;     /* its frames have a host's level */
};
#define SIM_XYZA_SPEED_MAX 20000

struct sim_xyza_config {
	const char *flash_path; /* null: parameters live as long as the process */
	unsigned number;        /* factory value of the slave number, 1..255 */
	unsigned axes;          /* 1..4 */
	unsigned programs;      /* 1.. this number exist */
	unsigned steps;         /* of each program, 1..65535 */
	db_time step_time;
	struct xyza_style style;
	struct sim_xyza_temper temper;
	/* Factory values; of items that all axes share the first one counts. */
	uint32_t defaults[XYZA_AXIS_COUNT][XYZA_ITEM_COUNT];
};

struct sim_xyza {
	struct sim_xyza_config config;
	char flash_path[PATH_MAX]; /* "": none */
	struct sim_xyza_memory memory;
	struct sim_xyza_axes axes;
	db_time now;
	bool powered;
	db_time reset_done; /* end of a running factory reset; DB_TIME_NEVER: none */

	uint16_t inputs;
	uint16_t outputs;

	enum xyza_program_state state;
	unsigned program;
	unsigned step;  /* from 1; 0 before the first one */
	unsigned delay; /* s, before a program's first step */
	bool single_step;
	db_time step_end; /* while RUNNING; or when a delayed start begins */
	bool starting;

	uint32_t counts[XYZA_VERB_COUNT]; /* how often each verb was carried out */
	uint32_t failures;                /* requests that were answered as failed */
};

/* Fills in usual values; the caller then changes what it needs. */
void sim_xyza_config_init(struct sim_xyza_config *config, unsigned number);

/* Powered on. Null when out of memory; to be freed with free(). Copies the configuration (the path
 * too). */
struct sim_xyza *sim_xyza_new(const struct sim_xyza_config *config, db_time now);

/* Lets axes and programs catch up. Only needed to keep later calls short. */
void sim_xyza_advance(struct sim_xyza *controller, db_time now);

/* Something changes as time passes. */
bool sim_xyza_busy(const struct sim_xyza *controller);

/*
 * Carries out a decoded request to this controller (the number is not checked; `error` is the
 * decoder's result) and fills in the reply. False when there is none: no power, or between a
 * factory reset and the power cycle after it.
 */
bool sim_xyza_execute(struct sim_xyza *controller, const struct xyza_request *request,
                      enum xyza_error error, db_time now, struct xyza_reply *reply);

/* Events from outside. A factory reset is complete when the power is switched off at least
 * SIM_XYZA_RESET_TIME after it; sooner, all stays as before. */
void sim_xyza_power(struct sim_xyza *controller, bool on, db_time now);
/* number 1..16. The keys for start, stop and pause act when their input becomes 1. */
void sim_xyza_set_input(struct sim_xyza *controller, unsigned number, bool level, db_time now);
/* Somebody changes an item at the controller's keys, of an axis or a shared one. */
void sim_xyza_set_item(struct sim_xyza *controller, enum xyza_item item, enum xyza_axis axis,
                       uint32_t content, db_time now);
/* Puts an axis at this position, at standstill. */
void sim_xyza_place(struct sim_xyza *controller, enum xyza_axis axis, int32_t position,
                    db_time now);

/* State for tests; more is in the struct. Call sim_xyza_advance() before. */
struct sim_xyza_axis_state {
	double position; /* pulses */
	double speed;    /* Hz, signed */
	bool standing;
};

struct sim_xyza_axis_state sim_xyza_axis_state(const struct sim_xyza *controller,
                                               enum xyza_axis axis);

#endif
