/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/vsmd_mechanics.h"

#include <math.h>

#define STEP_NS DB_NS_PER_MS
/* How long an attempt of a blocked closed-loop motor lasts before it counts for erty. */
#define RETRY_NS (20 * DB_NS_PER_MS)

/* Values of sNf and sNr. */
enum sensor_event {
	EVENT_NONE = 0,
	EVENT_ORIGIN = 1,
	EVENT_STOP = 2,
	EVENT_STOP_ORIGIN = 3,
	EVENT_HALT = 4,
	EVENT_HALT_ORIGIN = 5,
	EVENT_RUN_POSITIVE = 6,
	EVENT_RUN_NEGATIVE = 7,
	EVENT_OFFLINE_START = 8,
	EVENT_OFFLINE_STOP = 9,
};

static enum vsmd_param sensor_param(enum vsmd_param first, unsigned index, unsigned stride)
{
	return (enum vsmd_param)((unsigned)first + index * stride);
}

static bool closed_loop(const struct sim_vsmd *drive)
{
	return drive->config.closed_loop && drive->encoder_mode > 0;
}

static double shaft_of(const struct sim_vsmd *drive, const struct sim_motion *motion)
{
	return fmin(fmax(motion->position + drive->shaft_offset, drive->config.travel_min),
	            drive->config.travel_max);
}

double sim_mechanics_shaft(const struct sim_vsmd *drive)
{
	return shaft_of(drive, &drive->motion);
}

static bool sensor_high(const struct sim_vsmd *drive, unsigned index, double shaft)
{
	const struct sim_sensor *sensor = &drive->config.sensors[index];

	if (drive->params[sensor_param(VSMD_S1, index, 1)].u == 1)
		return (drive->outputs >> index) & 1;
	if (drive->forced[index] >= 0)
		return drive->forced[index] != 0;
	switch (sensor->kind) {
	case SIM_SENSOR_BELOW:
		return shaft < sensor->low;
	case SIM_SENSOR_ABOVE:
		return shaft > sensor->low;
	case SIM_SENSOR_BETWEEN:
		return shaft >= sensor->low && shaft <= sensor->high;
	case SIM_SENSOR_NONE:
	default:
		/* Nothing connected: the pull-up or pull-down determines the level. */
		return (drive->params[VSMD_PUD].u >> index) & 1;
	}
}

static uint32_t levels_at(const struct sim_vsmd *drive, double shaft)
{
	uint32_t levels = 0;

	for (unsigned i = 0; i < SIM_VSMD_SENSORS; i++)
		levels |= (uint32_t)sensor_high(drive, i, shaft) << i;
	return levels;
}

void sim_mechanics_set_position(struct sim_vsmd *drive, double position)
{
	drive->shaft_offset += drive->motion.position - position;
	sim_motion_set_position(&drive->motion, position);
}

static void update_limits(struct sim_vsmd *drive)
{
	int32_t min = drive->params[VSMD_SML].i;
	int32_t max = drive->params[VSMD_SPL].i;
	/* Before the origin is found the soft limits have no reference. */
	bool searching = drive->homing != SIM_HOMING_NONE && drive->homing != SIM_HOMING_SAFE;

	drive->motion.limit_min = min == 0 || searching ? -(double)INFINITY : (double)min;
	drive->motion.limit_max = max == 0 || searching ? (double)INFINITY : (double)max;
}

static void set_homing(struct sim_vsmd *drive, enum sim_homing homing)
{
	drive->homing = homing;
	update_limits(drive);
}

void sim_mechanics_abandon(struct sim_vsmd *drive)
{
	set_homing(drive, SIM_HOMING_NONE);
	drive->shake = SIM_SHAKE_NONE;
	drive->origin_after_stop = false;
	drive->counts_spd = false;
	drive->flags &= ~(uint32_t)VSMD_ST_ACT;
}

void sim_mechanics_release(struct sim_vsmd *drive)
{
	sim_mechanics_abandon(drive);
	sim_motion_halt(&drive->motion);
	if (!drive->config.temper.keeps_position)
		sim_mechanics_set_position(drive, 0.0);
	drive->flags &= ~(uint32_t)VSMD_ST_PWR;
}

void sim_mechanics_configure(struct sim_vsmd *drive)
{
	struct sim_motion *motion = &drive->motion;
	double speed = (double)drive->params[VSMD_SPD].f;

	motion->acc = (double)drive->params[VSMD_ACC].f;
	motion->dec = (double)drive->params[VSMD_DEC].f;
	update_limits(drive);
	if (drive->counts_spd && motion->mode == SIM_MOTION_VELOCITY)
		sim_motion_run(motion, speed);
	else if (drive->counts_spd && motion->mode == SIM_MOTION_POSITION)
		sim_motion_move(motion, motion->target_position, speed);
	sim_mechanics_hold_limits(drive);
	sim_mechanics_sense(drive);
}

void sim_mechanics_hold_limits(struct sim_vsmd *drive)
{
	int direction = sim_motion_direction(&drive->motion);
	/* The limit sensor in this direction, 1..6; 0: none. An output is none either. */
	uint32_t sensor = drive->params[direction < 0 ? VSMD_MSR : VSMD_PSR].u;
	uint32_t active = drive->params[direction < 0 ? VSMD_MSV : VSMD_PSV].u;

	if (direction == 0 || sensor == 0 ||
	    drive->params[sensor_param(VSMD_S1, sensor - 1, 1)].u == 1 ||
	    ((drive->levels >> (sensor - 1)) & 1) != active)
		return;
	sim_motion_halt(&drive->motion);
	/* One sensor may be both limit and origin: homing then continues from where it was held. */
	if (drive->homing != SIM_HOMING_NONE && sensor != drive->params[VSMD_SNR].u + 1)
		sim_mechanics_abandon(drive);
}

static bool origin_active(const struct sim_vsmd *drive)
{
	return ((drive->levels >> drive->params[VSMD_SNR].u) & 1) != drive->params[VSMD_OSV].u;
}

static void home_with(struct sim_vsmd *drive, enum sim_homing phase, double share)
{
	set_homing(drive, phase);
	sim_motion_run(&drive->motion, (double)drive->params[VSMD_ZSD].f * share);
	sim_mechanics_hold_limits(drive);
}

bool sim_mechanics_home(struct sim_vsmd *drive)
{
	uint32_t mode = drive->params[VSMD_ZMD].u;
	bool encoder = mode == 6 || mode == 7;

	if (mode == 0 || mode == 5 || drive->params[VSMD_ZSD].f == 0.0f)
		return false;
	if (encoder ? !closed_loop(drive) || (mode == 7 && drive->encoder_mode != 2) :
	              drive->params[sensor_param(VSMD_S1, drive->params[VSMD_SNR].u, 1)].u == 1)
		return false;
	sim_mechanics_abandon(drive);
	if (mode == 6)
		home_with(drive, SIM_HOMING_END_STOP, 1.0);
	else if (mode == 7) {
		double turn = ldexp((double)drive->params[VSMD_ESTP].u,
		                    (int)drive->params[VSMD_MCS].u);
		double speed = (double)drive->params[VSMD_ZSD].f;
		double shaft = sim_mechanics_shaft(drive);
		double mark = speed > 0.0 ? ceil((shaft + 1.0) / turn) * turn :
		                            floor((shaft - 1.0) / turn) * turn;

		set_homing(drive, SIM_HOMING_TURN_MARK);
		sim_motion_move(&drive->motion, mark - drive->shaft_offset, speed);
	} else if (origin_active(drive))
		home_with(drive, SIM_HOMING_LEAVE, -1.0);
	else
		home_with(drive, SIM_HOMING_APPROACH, 1.0);
	return true;
}

static void finish_homing(struct sim_vsmd *drive)
{
	set_homing(drive, SIM_HOMING_NONE);
	drive->flags |= VSMD_ST_ZERO | VSMD_ST_ACT;
}

static void found_origin(struct sim_vsmd *drive)
{
	uint32_t mode = drive->params[VSMD_ZMD].u;

	sim_motion_halt(&drive->motion);
	sim_mechanics_set_position(drive, 0.0);
	if (mode != 2 && mode != 4) {
		finish_homing(drive);
		return;
	}
	set_homing(drive, SIM_HOMING_SAFE);
	sim_motion_move(&drive->motion, drive->params[VSMD_ZSP].i,
	                (double)drive->params[VSMD_ZSD].f);
	sim_mechanics_hold_limits(drive);
}

/* Phases that the sensor ends. */
static void homing_by_sensor(struct sim_vsmd *drive, bool active, bool standing)
{
	bool twice = drive->params[VSMD_ZMD].u >= 3;

	switch (drive->homing) {
	case SIM_HOMING_LEAVE:
		if (!active)
			home_with(drive, SIM_HOMING_APPROACH, 1.0);
		break;
	case SIM_HOMING_APPROACH:
		if (active && !twice) {
			found_origin(drive);
		} else if (active) {
			set_homing(drive, SIM_HOMING_BRAKE);
			sim_motion_stop(&drive->motion);
		}
		break;
	case SIM_HOMING_BACKOFF:
		if (!active) {
			set_homing(drive, SIM_HOMING_TURN);
			sim_motion_stop(&drive->motion);
		}
		break;
	case SIM_HOMING_AGAIN:
		if (active)
			found_origin(drive);
		break;
	default:
		return;
	}
	/* Something else (the mechanical end, a command's limit) stopped the motor during the
	 * search. */
	if (standing && !sim_motion_moving(&drive->motion) &&
	    (drive->homing == SIM_HOMING_LEAVE || drive->homing == SIM_HOMING_APPROACH ||
	     drive->homing == SIM_HOMING_BACKOFF || drive->homing == SIM_HOMING_AGAIN))
		sim_mechanics_abandon(drive);
}

static void update_homing(struct sim_vsmd *drive)
{
	bool standing = !sim_motion_moving(&drive->motion);

	homing_by_sensor(drive, origin_active(drive), standing);
	if (!standing || sim_motion_moving(&drive->motion))
		return;
	switch (drive->homing) {
	case SIM_HOMING_BRAKE:
		home_with(drive, SIM_HOMING_BACKOFF, -0.5);
		break;
	case SIM_HOMING_TURN:
		home_with(drive, SIM_HOMING_AGAIN, 0.25);
		break;
	case SIM_HOMING_TURN_MARK:
		found_origin(drive);
		break;
	case SIM_HOMING_SAFE:
		finish_homing(drive);
		break;
	default:
		break;
	}
}

void sim_mechanics_shake(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	double count = (double)command->shake_count;

	sim_mechanics_abandon(drive);
	drive->shake = SIM_SHAKE_TO_START;
	drive->shake_end = command->shake_end;
	drive->shake_frequency = command->shake_frequency;
	/* A time limit ends with the full oscillation in which it expires. */
	drive->shake_cycles = command->verb == VSMD_SHAKE_TIME ?
	                              ceil(count * (double)command->shake_frequency) :
	                              count;
	sim_motion_move(&drive->motion, command->shake_start, (double)drive->params[VSMD_SPD].f);
	sim_mechanics_hold_limits(drive);
}

static void sensor_event(struct sim_vsmd *drive, enum sensor_event event)
{
	double speed = fabs((double)drive->params[VSMD_SPD].f);

	switch (event) {
	case EVENT_ORIGIN:
		sim_mechanics_set_position(drive, 0.0);
		break;
	case EVENT_STOP:
	case EVENT_STOP_ORIGIN:
	case EVENT_HALT:
	case EVENT_HALT_ORIGIN:
		if (drive->homing == SIM_HOMING_NONE)
			sim_mechanics_abandon(drive);
		if (event == EVENT_HALT || event == EVENT_HALT_ORIGIN)
			sim_motion_halt(&drive->motion);
		else
			sim_motion_stop(&drive->motion);
		drive->origin_after_stop = event == EVENT_STOP_ORIGIN || event == EVENT_HALT_ORIGIN;
		break;
	case EVENT_RUN_POSITIVE:
	case EVENT_RUN_NEGATIVE:
		if (!(drive->flags & VSMD_ST_PWR))
			break;
		sim_mechanics_abandon(drive);
		sim_motion_run(&drive->motion, event == EVENT_RUN_POSITIVE ? speed : -speed);
		break;
	case EVENT_OFFLINE_START:
		drive->flags |= VSMD_ST_ACTION;
		break;
	case EVENT_OFFLINE_STOP:
		drive->flags &= ~(uint32_t)VSMD_ST_ACTION;
		break;
	case EVENT_NONE:
	default:
		break;
	}
}

void sim_mechanics_settle(struct sim_vsmd *drive)
{
	drive->levels = levels_at(drive, sim_mechanics_shaft(drive));
}

void sim_mechanics_sense(struct sim_vsmd *drive)
{
	uint32_t before = drive->levels;
	uint32_t changed;

	sim_mechanics_settle(drive);
	changed = before ^ drive->levels;
	for (unsigned i = 0; i < SIM_VSMD_SENSORS && drive->powered; i++) {
		bool rising = (drive->levels >> i) & 1;
		enum vsmd_param event = sensor_param(rising ? VSMD_S1R : VSMD_S1F, i, 2);

		if (((changed >> i) & 1) && drive->params[sensor_param(VSMD_S1, i, 1)].u == 0)
			sensor_event(drive, (enum sensor_event)drive->params[event].u);
	}
	if (drive->powered) {
		/* Reactions to the present position of the motor and state of the sensors. */
		sim_mechanics_hold_limits(drive);
		update_homing(drive);
		if (drive->shake == SIM_SHAKE_TO_START && !sim_motion_moving(&drive->motion)) {
			/* A limit may have stopped it before the start: then there is no
			 * oscillation. */
			drive->shake = drive->motion.position == drive->motion.target_position ?
			                       SIM_SHAKE_RUN :
			                       SIM_SHAKE_NONE;
			if (drive->shake == SIM_SHAKE_RUN)
				sim_motion_shake(&drive->motion, drive->shake_end,
				                 (double)drive->shake_frequency,
				                 drive->shake_cycles);
		} else if (drive->shake != SIM_SHAKE_NONE && !sim_motion_moving(&drive->motion)) {
			drive->shake = SIM_SHAKE_NONE;
			drive->flags |= VSMD_ST_ACT;
		}
		if (drive->origin_after_stop && !sim_motion_moving(&drive->motion)) {
			drive->origin_after_stop = false;
			sim_mechanics_set_position(drive, 0.0);
		}
	}
}

/* The shaft cannot follow. `before` is the motion before the step that just ended. */
static void hold_shaft(struct sim_vsmd *drive, const struct sim_motion *before, double shaft)
{
	uint32_t retries = drive->params[VSMD_ERTY].u;
	uint32_t reaction = drive->params[VSMD_EWR].u;

	if (!closed_loop(drive)) {
		drive->shaft_offset = shaft - drive->motion.position;
		return;
	}
	drive->blocked += drive->motion.time - before->time;
	drive->motion.position = shaft - drive->shaft_offset;
	drive->motion.velocity = 0.0;
	if (drive->homing == SIM_HOMING_END_STOP) {
		if (drive->blocked >= RETRY_NS)
			found_origin(drive);
		return;
	}
	if (retries == 0 || drive->blocked < (db_time)retries * RETRY_NS)
		return;
	drive->flags |= VSMD_ST_ENC_ERR;
	if (reaction == 0)
		return;
	sim_mechanics_abandon(drive);
	sim_motion_halt(&drive->motion);
	if (reaction == 2)
		sim_mechanics_release(drive);
}

/* The first moment in (before, end] at which a sensor changes: sensors see whole pulses, not
 * steps. */
static db_time first_edge(const struct sim_vsmd *drive, const struct sim_motion *before,
                          db_time end)
{
	db_time early = before->time;
	db_time late = end;

	while (late - early > 1) {
		struct sim_motion probe = *before;
		db_time middle = early + (late - early) / 2;

		sim_motion_advance(&probe, middle);
		if (levels_at(drive, shaft_of(drive, &probe)) != drive->levels)
			late = middle;
		else
			early = middle;
	}
	return late;
}

void sim_mechanics_advance(struct sim_vsmd *drive, db_time now)
{
	while (drive->motion.time < now) {
		db_time end = drive->motion.time + STEP_NS < now ? drive->motion.time + STEP_NS :
		                                                   now;
		struct sim_motion before = drive->motion;
		double old_shaft, shaft;

		if (!sim_motion_moving(&drive->motion)) {
			sim_motion_advance(&drive->motion, now);
			break;
		}
		old_shaft = sim_mechanics_shaft(drive);
		sim_motion_advance(&drive->motion, end);
		shaft = drive->stalled ? old_shaft : sim_mechanics_shaft(drive);
		if (!drive->stalled && levels_at(drive, shaft) != drive->levels) {
			drive->motion = before;
			sim_motion_advance(&drive->motion, first_edge(drive, &before, end));
			shaft = sim_mechanics_shaft(drive);
		}
		if (drive->motion.position + drive->shaft_offset != shaft)
			hold_shaft(drive, &before, shaft);
		else
			drive->blocked = 0;
		sim_mechanics_sense(drive);
	}
	if (drive->offline_start <= now) {
		drive->offline_start = DB_TIME_NEVER;
		drive->flags |= VSMD_ST_ACTION;
	}
}
