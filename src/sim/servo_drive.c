/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/servo_drive.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STEP (250 * DB_NS_PER_US) /* of the integration, and of the drive's own loops */
#define STEP_S ((double)STEP / (double)DB_NS_PER_S)

#define RPM_PER_RAD_S (60.0 / (2.0 * 3.14159265358979323846))
#define SECONDS_PER_MINUTE 60.0

#define SPEED_LOOP_S 0.002 /* time constant of the speed loop */
#define POSITION_GAIN 40.0 /* 1/s */
#define ZERO_SPEED 1.0     /* rpm below which the drive usually reports standstill */
#define REACHED_SPEED 2.0  /* rpm around the speed that count as reached */
#define AT_REST_COUNTS 0.5 /* the position loop is at rest this close to its target ... */
#define AT_REST_RPM 3.0    /* ... and this slow */
#define CTRG SERVO_CAN_CTRG
#define DITHER_TIME (7 * DB_NS_PER_MS) /* in each direction */

/* --- making ----------------------------------------------------------------------------------- */

void sim_servo_config_init(struct sim_servo_config *config)
{
	*config = (struct sim_servo_config){
		.mode = SERVO_CAN_MODE_POSITION,
		.reports = { 100 * DB_NS_PER_MS, 100 * DB_NS_PER_MS, 1000 * DB_NS_PER_MS },
		.power_time = 5 * DB_NS_PER_MS,
		.counts_per_turn = 10000,
		.window = 10,
		.inertia = 1e-4,
		.torque_constant = 0.1,
		.friction = 0.02,
		.max_current = 10,
		.max_speed = 3000,
		.acceleration = 10000,
		.deceleration = 10000,
		.voltage = 480,
		.temperature = 35,
		/* The document's values. */
		.dialect = {
			.places = "0123456789abcdef",
			.moving_bit = -1,
			.demand_step = 1,
			.move_step = 1,
			.speed_step = 1,
			.setpoint_step = 1,
			.current_step = 0.1,
			.current_setpoint_step = 0.1,
		},
	};
}

/* What a loss of power resets. The encoder and the shaft keep their positions. */
static void boot_drive(struct sim_servo *drive, db_time now)
{
	const struct sim_servo_config *config = &drive->config;

	drive->mode = config->mode;
	drive->torque_clockwise = false;
	drive->enabled = drive->shown_enabled = false;
	drive->speed = drive->current = 0;
	drive->speed_staged = drive->current_staged = false;
	memset(drive->internal_positions, 0, sizeof(drive->internal_positions));
	drive->word0 = 0;
	drive->max_speed = config->max_speed;
	drive->acceleration = config->acceleration;
	drive->deceleration = config->deceleration;
	drive->faults = 0;
	drive->target = config->temper.demand == SIM_SERVO_DEMAND_POSITION ? drive->position : 0;
	drive->planned = drive->position;
	drive->idle_until = now;
	for (size_t i = 0; i < SIM_SERVO_REPORTS; i++)
		drive->report_at[i] = drive->config.reports[i] > 0 ?
		                              now + drive->config.reports[i] :
		                              DB_TIME_NEVER;
}

struct sim_servo *sim_servo_new(const struct sim_servo_config *config, db_time now)
{
	struct sim_servo *drive = calloc(1, sizeof(*drive));

	if (!drive)
		return NULL;
	drive->config = *config;
	drive->time = now;
	drive->powered = true;
	drive->position = config->start;
	drive->voltage = config->voltage;
	drive->temperature = config->temperature;
	boot_drive(drive, now);
	return drive;
}

/* --- the motor -------------------------------------------------------------------------------- */

static double clamp_to(double value, double limit)
{
	return value > limit ? limit : value < -limit ? -limit : value;
}

static double wanted_current(struct sim_servo *drive)
{
	const struct sim_servo_config *config = &drive->config;
	double wanted, most, angular, torque;
	bool slower;

	if (drive->mode == SERVO_CAN_MODE_CURRENT) {
		drive->profile = drive->rpm;
		/* The speed limit removes a current that would accelerate further. */
		return fabs(drive->rpm) >= drive->max_speed && drive->current * drive->rpm > 0 ?
		               0 :
		               drive->current;
	}
	if (drive->mode == SERVO_CAN_MODE_SPEED) {
		wanted = clamp_to(drive->speed, drive->max_speed);
	} else {
		/* Low enough to stop at the target with the deceleration. */
		double left = drive->target - drive->position;
		double per_rpm = config->counts_per_turn / SECONDS_PER_MINUTE; /* counts/s */
		double braking = sqrt(2.0 * drive->deceleration * fabs(left) / per_rpm);

		wanted = fabs(left) * POSITION_GAIN / per_rpm;
		wanted = copysign(fmin(fmin(wanted, braking), drive->max_speed), left);
	}
	/* The profile approaches that speed: with the deceleration when that is slower. */
	slower = fabs(wanted) < fabs(drive->profile) || wanted * drive->profile < 0;
	most = (slower ? drive->deceleration : drive->acceleration) * STEP_S;
	drive->profile += clamp_to(wanted - drive->profile, most);
	/* The speed loop: the current that accelerates the motor to the profile's speed. */
	angular = (drive->profile - drive->rpm) / RPM_PER_RAD_S / SPEED_LOOP_S;
	torque = config->inertia * angular + config->load;
	if (drive->profile != 0)
		torque += copysign(config->friction, drive->profile);
	return torque / config->torque_constant;
}

bool sim_servo_settled(const struct sim_servo *drive)
{
	if (drive->rpm != 0 || drive->shown_enabled != drive->enabled ||
	    drive->planned != drive->target || drive->time < drive->idle_until ||
	    fabs(drive->config.load) > drive->config.friction)
		return false;
	if (!drive->enabled || drive->faults != 0)
		return drive->amperes == 0;
	switch (drive->mode) {
	case SERVO_CAN_MODE_SPEED:
		return drive->speed == 0 && drive->profile == 0;
	case SERVO_CAN_MODE_CURRENT:
		return drive->current == 0 && drive->amperes == 0;
	default:
		return drive->position == drive->target;
	}
}

void sim_servo_advance(struct sim_servo *drive, db_time now)
{
	const struct sim_servo_config *config = &drive->config;

	while (now - drive->time >= STEP) {
		bool driven = drive->enabled && drive->faults == 0; /* the power stage is on */
		double wanted = 0;
		double torque, before, free_rpm, brake;
		/* Calculates the reference at full speed. */
		double most = drive->max_speed / SECONDS_PER_MINUTE * config->counts_per_turn;

		if (sim_servo_settled(drive)) {
			drive->time += (now - drive->time) / STEP * STEP;
			return;
		}
		drive->planned += clamp_to(drive->target - drive->planned, most * STEP_S);
		if (driven && drive->time >= drive->idle_until)
			wanted = wanted_current(drive);
		else
			drive->profile = drive->rpm;
		drive->amperes = clamp_to(wanted, config->max_current);
		drive->limited = drive->amperes != wanted;
		/* The shaft turns. Friction slows down, but never reverses a motor, and holds a
		 * standing one. */
		torque = drive->amperes * config->torque_constant - config->load;
		before = drive->rpm;
		free_rpm = before + torque / config->inertia * RPM_PER_RAD_S * STEP_S;
		brake = config->friction / config->inertia * RPM_PER_RAD_S * STEP_S;
		drive->rpm = fabs(free_rpm) <= brake ? 0 : free_rpm - copysign(brake, free_rpm);
		if (drive->blocked)
			drive->rpm = 0;
		drive->position += (before + drive->rpm) / 2.0 / SECONDS_PER_MINUTE *
		                   config->counts_per_turn * STEP_S;
		if (drive->mode == SERVO_CAN_MODE_POSITION && driven &&
		    fabs(drive->target - drive->position) <= AT_REST_COUNTS &&
		    fabs(drive->rpm) <= AT_REST_RPM) {
			drive->position = drive->target;
			drive->rpm = 0;
			drive->profile = 0;
		}
		drive->time += STEP;
		if (drive->shown_enabled != drive->enabled &&
		    drive->time - drive->enabled_at >= config->power_time)
			drive->shown_enabled = drive->enabled;
	}
}

/* --- the host's messages ---------------------------------------------------------------------- */

/* Is the shaft held at the demand, or on its way there? */
static bool is_held(const struct sim_servo *drive)
{
	return drive->enabled && drive->mode == SERVO_CAN_MODE_POSITION;
}

static void go_to(struct sim_servo *drive, double target)
{
	drive->target = target;
	drive->planned = drive->position;
}

static void hold_here(struct sim_servo *drive)
{
	if (drive->config.temper.demand == SIM_SERVO_DEMAND_POSITION)
		go_to(drive, drive->position);
}

static void set_enabled(struct sim_servo *drive, bool enabled, db_time now)
{
	if (drive->enabled == enabled)
		return;
	drive->enabled = enabled;
	drive->enabled_at = now;
	drive->profile = drive->rpm;
	hold_here(drive);
}

static void set_mode(struct sim_servo *drive, const struct servo_can_message *message)
{
	enum servo_can_mode mode = message->u.mode.mode;

	if (message->u.mode.has_max_speed)
		drive->max_speed = message->u.mode.max_speed;
	drive->torque_clockwise = message->u.mode.torque_clockwise;
	if (mode == drive->mode)
		return;
	drive->mode = mode;
	drive->profile = drive->rpm;
	hold_here(drive);
}

/* With a synchronous drive, speed and current wait for the sync frame. */
static void set_setpoint(struct sim_servo *drive, const struct servo_can_message *message,
                         db_time now)
{
	const struct sim_servo_dialect *dialect = &drive->config.dialect;
	bool waits = drive->config.synchronous;

	if (message->kind == SERVO_CAN_SPEED) {
		*(waits ? &drive->next_speed : &drive->speed) = message->u.speed *
		                                                dialect->setpoint_step;
		drive->speed_staged |= waits;
	} else {
		*(waits ? &drive->next_current : &drive->current) = message->u.current *
		                                                    dialect->current_setpoint_step;
		drive->current_staged |= waits;
	}
	if (waits)
		return;
	drive->setpoint_at = now;
	drive->idle_until = now + drive->config.temper.motion_delay;
}

static void set_words(struct sim_servo *drive, uint16_t word0, db_time now)
{
	bool rises = (word0 & CTRG) && !(drive->word0 & CTRG);
	double target = drive->internal_positions[word0 / SERVO_CAN_POS0 & SERVO_CAN_SLOT_MAX];

	drive->word0 = word0;
	if (!rises || drive->config.temper.ignores_trigger)
		return;
	if (!is_held(drive)) {
		if (drive->config.temper.demand == SIM_SERVO_DEMAND_TRIGGERED)
			go_to(drive, target);
		return;
	}
	go_to(drive, target);
	drive->idle_until = now + drive->config.temper.motion_delay;
	drive->moves++;
}

/* A move by its own frame also sets the demand without holding, for drives that keep one. */
static void move(struct sim_servo *drive, int64_t steps, db_time now)
{
	const struct sim_servo_dialect *dialect = &drive->config.dialect;
	double way = sim_servo_dialect_turn(dialect, (double)steps * dialect->move_step);
	double target = dialect->moves_relatively ? drive->position + way : way;

	if (!is_held(drive) && drive->config.temper.demand == SIM_SERVO_DEMAND_POSITION)
		return;
	go_to(drive, target);
	if (!is_held(drive))
		return;
	drive->idle_until = now + drive->config.temper.motion_delay;
	drive->moves++;
}

static void obey(struct sim_servo *drive, const struct servo_can_message *message, unsigned slot,
                 db_time now)
{
	/* after a fault */
	bool goes_on = drive->config.temper.fault_power != SIM_SERVO_FAULT_DISABLES;
	const struct sim_servo_dialect *dialect = &drive->config.dialect;
	double demand;

	switch (message->kind) {
	case SERVO_CAN_SYNC:
		if (drive->speed_staged || drive->current_staged)
			drive->setpoint_at = now;
		if (drive->speed_staged)
			drive->speed = drive->next_speed;
		if (drive->current_staged)
			drive->current = drive->next_current;
		drive->speed_staged = drive->current_staged = false;
		break;
	case SERVO_CAN_ENABLE:
		set_enabled(drive, message->u.enable && (drive->faults == 0 || goes_on), now);
		break;
	case SERVO_CAN_MODE:
		set_mode(drive, message);
		break;
	case SERVO_CAN_SPEED:
	case SERVO_CAN_CURRENT:
		set_setpoint(drive, message, now);
		break;
	case SERVO_CAN_POSITION:
		demand = sim_servo_dialect_turn(dialect,
		                                message->u.position * dialect->demand_step);
		drive->internal_positions[slot] = demand;
		if (drive->config.temper.demand == SIM_SERVO_DEMAND_WRITTEN && !is_held(drive))
			go_to(drive, demand);
		break;
	case SERVO_CAN_MOVE:
		move(drive, message->u.target, now);
		break;
	case SERVO_CAN_SET_FEEDBACK:
		drive->position = sim_servo_dialect_turn(dialect, message->u.position);
		if (!drive->enabled)
			hold_here(drive);
		break;
	case SERVO_CAN_RAMPS:
		drive->acceleration = message->u.ramps.acceleration;
		drive->deceleration = message->u.ramps.deceleration;
		break;
	case SERVO_CAN_WORDS:
		set_words(drive, message->u.words.word0, now);
		break;
	default:
		break;
	}
}

/* --- answers ---------------------------------------------------------------------------------- */

static int32_t whole_position(const struct sim_servo *drive)
{
	double shown = drive->position;

	/* A held position trembles. */
	if (is_held(drive) && drive->rpm == 0)
		shown += drive->time / DITHER_TIME % 2 == 0 ? drive->config.temper.dither :
		                                              -drive->config.temper.dither;
	shown = sim_servo_dialect_turn(&drive->config.dialect, shown);
	return (int32_t)(uint32_t)(int64_t)llrint(shown);
}

static int16_t shown_speed(const struct sim_servo *drive)
{
	double rpm = drive->config.temper.unsigned_speed ? fabs(drive->rpm) : drive->rpm;

	return sim_servo_dialect_steps(rpm, drive->config.dialect.speed_step);
}

static int16_t shown_current(const struct sim_servo *drive)
{
	return sim_servo_dialect_steps(drive->amperes, drive->config.dialect.current_step);
}

static uint16_t status_bits(const struct sim_servo *drive)
{
	double at = drive->config.temper.reached_by_profile ? drive->planned : drive->position;
	unsigned bits = 0;

	if (drive->shown_enabled &&
	    !(drive->faults && drive->config.temper.fault_power == SIM_SERVO_FAULT_RESUMES))
		bits |= SERVO_CAN_ST_STARTED | SERVO_CAN_ST_RUNNING | SERVO_CAN_ST_BRAKE_OUTPUT;
	if (fabs(drive->rpm) < fmax(drive->config.temper.zero_speed, ZERO_SPEED))
		bits |= SERVO_CAN_ST_ZERO_SPEED;
	if (drive->mode == SERVO_CAN_MODE_SPEED && fabs(drive->rpm - drive->speed) <= REACHED_SPEED)
		bits |= SERVO_CAN_ST_SPEED_REACHED;
	if (drive->mode == SERVO_CAN_MODE_POSITION &&
	    fabs(drive->target - at) <= drive->config.window)
		bits |= SERVO_CAN_ST_POSITION_REACHED;
	if (drive->limited)
		bits |= SERVO_CAN_ST_TORQUE_LIMITED;
	if (drive->faults)
		bits |= SERVO_CAN_ST_ERROR;
	if (drive->rpm <= -ZERO_SPEED)
		bits |= SERVO_CAN_ST_REVERSE;
	if (drive->rpm >= ZERO_SPEED)
		bits |= SERVO_CAN_ST_FORWARD;
	return (uint16_t)drive->forced | sim_servo_dialect_status(&drive->config.dialect, bits,
	                                                          fabs(drive->rpm) >= ZERO_SPEED);
}

static size_t answer(const struct sim_servo *drive, const struct servo_can_message *message,
                     struct servo_can_message *replies)
{
	unsigned answers = servo_can_answers(message->u.selector);
	struct servo_can_message *reply = replies;

	memset(replies, 0, SIM_SERVO_REPLIES * sizeof(replies[0]));
	for (size_t i = 0; i < SIM_SERVO_REPLIES; i++)
		replies[i].node = message->node;
	if (answers & SERVO_CAN_GIVES_POSITION) {
		reply->kind = SERVO_CAN_ANSWER_POSITION;
		reply++->u.position = whole_position(drive);
	}
	if (answers & SERVO_CAN_GIVES_MOTION) {
		reply->kind = SERVO_CAN_ANSWER_MOTION;
		reply->u.motion.speed = shown_speed(drive);
		reply++->u.motion.current = shown_current(drive);
	}
	if (answers & SERVO_CAN_GIVES_STATUS) {
		reply->kind = SERVO_CAN_ANSWER_STATUS;
		reply->u.status.bits = status_bits(drive);
		reply++->u.status.inputs = drive->inputs;
	}
	if (answers & SERVO_CAN_GIVES_ANALOGUE) {
		reply->kind = SERVO_CAN_ANSWER_ANALOGUE;
		reply++->u.analogue = drive->analogue;
	}
	return (size_t)(reply - replies);
}

size_t sim_servo_execute(struct sim_servo *drive, const struct servo_can_message *message,
                         const struct servo_can_layout *layout, db_time now,
                         struct servo_can_message replies[SIM_SERVO_REPLIES])
{
	struct servo_can_message *reply = &replies[0];

	if (!drive->powered || message->kind <= SERVO_CAN_FOREIGN || message->kind >= SERVO_CAN_ACK)
		return 0;
	sim_servo_advance(drive, now);
	drive->counts[message->kind]++;
	if (drive->config.temper.deaf_to_setpoints &&
	    ((message->kind == SERVO_CAN_SPEED && drive->mode != SERVO_CAN_MODE_SPEED) ||
	     (message->kind == SERVO_CAN_CURRENT && drive->mode != SERVO_CAN_MODE_CURRENT)))
		return 0;
	if (message->kind == SERVO_CAN_READ)
		return answer(drive, message, replies);
	obey(drive, message, layout->slot, now);
	*reply = (struct servo_can_message){ .kind = SERVO_CAN_ACK, .node = message->node };
	reply->u.ack.code = servo_can_ack_expected(message, layout);
	if (message->kind == SERVO_CAN_SPEED)
		reply->u.ack.value = shown_speed(drive);
	if (message->kind == SERVO_CAN_CURRENT)
		reply->u.ack.value = shown_current(drive);
	return reply->u.ack.code == SERVO_CAN_ACK_NONE ? 0 : 1;
}

/* --- reports ---------------------------------------------------------------------------------- */

static enum sim_servo_report next_report(const struct sim_servo *drive)
{
	size_t first = 0;

	for (size_t i = 1; i < SIM_SERVO_REPORTS; i++) {
		if (drive->report_at[i] < drive->report_at[first])
			first = i;
	}
	return (enum sim_servo_report)first;
}

db_time sim_servo_next(const struct sim_servo *drive)
{
	return drive->powered ? drive->report_at[next_report(drive)] : DB_TIME_NEVER;
}

bool sim_servo_report(struct sim_servo *drive, db_time now, struct servo_can_message *report)
{
	enum sim_servo_report due = next_report(drive);

	if (!drive->powered || drive->report_at[due] > now)
		return false;
	sim_servo_advance(drive, now);
	memset(report, 0, sizeof(*report));
	switch (due) {
	case SIM_SERVO_REPORT_POSITION:
		report->kind = SERVO_CAN_REPORT_POSITION;
		report->u.position = whole_position(drive);
		break;
	case SIM_SERVO_REPORT_MOTION:
		report->kind = SERVO_CAN_REPORT_MOTION;
		report->u.motion.speed = shown_speed(drive);
		report->u.motion.current = shown_current(drive);
		break;
	default:
		report->kind = SERVO_CAN_REPORT_HEALTH;
		report->u.health.voltage = drive->voltage;
		report->u.health.temperature = drive->temperature;
		report->u.health.faults = drive->faults;
		break;
	}
	drive->report_at[due] += drive->config.reports[due];
	/* After a late call, missed reports are not sent. */
	if (drive->report_at[due] <= now)
		drive->report_at[due] = now + drive->config.reports[due];
	return true;
}

void sim_servo_set_reports(struct sim_servo *drive, enum sim_servo_report report, db_time interval,
                           db_time now)
{
	drive->config.reports[report] = interval;
	drive->report_at[report] = interval > 0 ? now + interval : DB_TIME_NEVER;
}

/* --- from outside ----------------------------------------------------------------------------- */

void sim_servo_power(struct sim_servo *drive, bool on, db_time now)
{
	sim_servo_advance(drive, now);
	if (drive->powered == on)
		return;
	drive->powered = on;
	if (drive->config.temper.counts_anew)
		drive->position = 0;
	boot_drive(drive, now);
}

void sim_servo_set_faults(struct sim_servo *drive, uint16_t faults, db_time now)
{
	sim_servo_advance(drive, now);
	drive->faults = faults;
	if (faults && drive->config.temper.fault_power == SIM_SERVO_FAULT_DISABLES)
		set_enabled(drive, false, now);
}
