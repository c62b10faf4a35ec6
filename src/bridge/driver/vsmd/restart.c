/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/restart.h"

#include <math.h>

/* A closed loop trembles by some counts: only a longer way is a motion. */
#define POSITION_NOISE 16.0
/* A drive whose counter has just restarted is this near to 0, in counts. */
#define BEGINNING 2.0

/* The handshake bit of some drives is cleared after a while. If it stays set for longer than this,
 * it is not. */
#define HANDSHAKE_LAPSES (60 * DB_NS_PER_S)

#define FAULTS                                                                             \
	(VSMD_ST_FLT | VSMD_ST_ENC_ERR | VSMD_ST_OVER_CURRENT | VSMD_ST_OVER_TEMPERATURE | \
	 VSMD_ST_VOLTAGE)

/* The previous status and the new one. */
struct pair {
	const struct vsmd_axis *axis;
	uint32_t before;
	uint32_t word;
	uint32_t dropped; /* bits that were set before, and are not any more */
	uint32_t kept;    /* bits that are set in both */
	int32_t position;
	double way; /* between the two */
	db_time now;
};

static bool is_far(const struct vsmd_axis *axis, double way)
{
	return way > fmax(axis->window, POSITION_NOISE);
}

static bool is_at_beginning(const struct vsmd_axis *axis, int32_t position)
{
	return fabs((double)position) <= fmax(axis->window, BEGINNING);
}

/* True if it is where it was, and not where counters begin: it has kept counting. */
static bool counts_on(const struct vsmd_axis *axis, int32_t before, int32_t position)
{
	double way = fabs((double)before - (double)position);

	return !is_far(axis, way) && (is_far(axis, fabs((double)position)) ||
	                              (way <= 0.0 && !is_at_beginning(axis, position)));
}

/* True if a sensor may be set to make its place the origin. */
static bool sensors_set_origin(const struct vsmd_axis *axis)
{
	for (unsigned param = VSMD_S1F; param <= VSMD_S6R; param++) {
		uint32_t event = axis->plate.values[param].u;

		if ((axis->plate.valid[0] >> param & 1) && (event == 1 || event == 3 || event == 5))
			return true;
	}
	return false;
}

/* True if a drive that moved when last read can have stopped at 0 by itself. */
static bool may_have_come(const struct pair *pair)
{
	const struct vsmd_axis *axis = pair->axis;
	double seconds = (double)(pair->now - axis->status_at) / (double)DB_NS_PER_S;
	bool known = axis->plate.valid[0] >> VSMD_SPD & 1;
	double preset = known ? (double)axis->plate.values[VSMD_SPD].f : (double)VSMD_SPEED_MAX;
	double seen = fmax(fabs((double)axis->last.velocity), fabs((double)axis->process.velocity));
	double highest = fmax(fmax(preset, seen), fabs((double)axis->goal.velocity));

	if (axis->away)
		return axis->goal.kind == VSMD_GOAL_POSITION &&
		       vsmd_is_at(axis, axis->goal.position, 0);
	return pair->way <= 2.0 * highest * seconds + fmax(axis->window, POSITION_NOISE);
}

/* True if it stands where counters begin, and cannot have moved there. */
static bool has_jumped(const struct pair *pair)
{
	const struct vsmd_axis *axis = pair->axis;

	if (!(pair->word & VSMD_ST_STP) || !is_at_beginning(axis, pair->position) ||
	    !is_far(axis, pair->way) || sensors_set_origin(axis))
		return false;
	if (!(pair->before & VSMD_ST_STP))
		return !may_have_come(pair);
	return axis->away || (axis->motion == VSMD_MOTION_NONE && axis->begun == VSMD_MOTION_NONE &&
	                      !axis->just_commanded);
}

/* A restarted drive stands at its beginning, if it is not set to home by itself. */
static bool has_lost_homing(const struct pair *pair)
{
	const struct db_nameplate *plate = &pair->axis->plate;
	bool homes_itself = (plate->valid[0] >> VSMD_ZAR & 1) && plate->values[VSMD_ZAR].u == 1;

	return (pair->dropped & VSMD_ST_ZERO) &&
	       (homes_itself ||
	        ((pair->word & VSMD_ST_STP) && is_at_beginning(pair->axis, pair->position)));
}

/* True if a command, or its present motion, changes position, power and homing bit. */
static bool is_asked_for(const struct pair *pair)
{
	const struct vsmd_axis *axis = pair->axis;

	if (pair->word & ~pair->before & VSMD_ST_ZERO)
		return true;
	return !axis->away &&
	       (axis->motion == VSMD_MOTION_HOMING || axis->begun == VSMD_MOTION_HOMING ||
	        axis->status_at <= axis->effect_until);
}

/* By itself it proves little: in some drives it is cleared after a while. */
static bool handshake_counts(const struct pair *pair)
{
	const struct vsmd_axis *axis = pair->axis;

	return (pair->dropped & VSMD_ST_HS) && (pair->word & VSMD_ST_STP) &&
	       !(pair->kept & VSMD_ST_ZERO) &&
	       (!axis->handshake_lapses ||
	        axis->status_at - axis->handshake_since > HANDSHAKE_LAPSES);
}

static enum vsmd_verdict judge_signs(const struct pair *pair, unsigned signs, bool handshake)
{
	const struct vsmd_axis *axis = pair->axis;
	const struct db_nameplate *plate = &axis->plate;
	/* A drive that switches its motor off at power-up would have it off. */
	bool kept_power = (pair->kept & VSMD_ST_PWR) && (plate->valid[0] >> VSMD_PAE & 1) &&
	                  plate->values[VSMD_PAE].u == 0;

	if (signs + handshake >= 2 || (axis->away && signs + handshake == 1))
		return VSMD_RESTARTED;
	if (signs == 1)
		return VSMD_MAY_HAVE_RESTARTED;
	if (axis->away) {
		/* It was silent, and nothing in its status indicates a restart. */
		bool near = is_at_beginning(axis, pair->position) && !is_far(axis, pair->way);

		if (axis->params_differ)
			return VSMD_RESTARTED;
		if (!(pair->before & VSMD_ST_STP) || kept_power || !(axis->placed || axis->homed))
			return VSMD_COUNTS_ON;
		/* At 0 before and now: a restart would look the same. At another place than
		 * before: the cause of the motion is unknown. */
		return near || is_far(axis, pair->way) ? VSMD_MAY_HAVE_RESTARTED : VSMD_COUNTS_ON;
	}
	return handshake && !kept_power && (axis->placed || axis->homed) ? VSMD_MAY_HAVE_RESTARTED :
	                                                                   VSMD_COUNTS_ON;
}

struct vsmd_restart vsmd_judge_restart(const struct vsmd_axis *axis, int32_t position,
                                       uint32_t word, db_time now)
{
	const struct pair pair = {
		.axis = axis,
		.before = axis->last.status,
		.word = word,
		.dropped = axis->last.status & ~word,
		.kept = axis->last.status & word,
		.position = position,
		.way = fabs((double)axis->last.position - (double)position),
		.now = now,
	};
	struct vsmd_restart restart = { .verdict = VSMD_COUNTS_ON };
	bool goes_on = counts_on(axis, axis->last.position, position) ||
	               (axis->away && (pair.kept & VSMD_ST_ZERO));
	bool power;
	bool homing;
	bool jump;
	bool handshake;

	/* The usual case: nothing in the status has to be judged. */
	if (is_asked_for(&pair) || goes_on)
		return restart;
	power = (pair.dropped & VSMD_ST_PWR) != 0;
	homing = has_lost_homing(&pair);
	jump = has_jumped(&pair);
	handshake = handshake_counts(&pair);
	/* A motor that is switched off loses its origin, too; one with power cannot be pushed to
	 * 0. */
	restart.origin_lost = (power && is_at_beginning(axis, position)) || homing ||
	                      (jump && (pair.kept & VSMD_ST_PWR));
	/* The bit of an encoder error is kept until it is cleared, but not without power. */
	if ((pair.word & VSMD_ST_ENC_ERR) || (pair.word & ~pair.before & FAULTS)) {
		restart.verdict = power || jump ? VSMD_DISABLED_ITSELF : VSMD_COUNTS_ON;
		return restart;
	}
	restart.verdict = judge_signs(&pair, (unsigned)power + homing + jump, handshake);
	restart.reread = restart.verdict != VSMD_COUNTS_ON || handshake;
	return restart;
}

bool vsmd_refutes_doubt(const struct vsmd_axis *axis, int32_t position)
{
	return counts_on(axis, axis->doubt.position, position);
}
