/* SPDX-License-Identifier: Apache-2.0 */
/* Frames from the drive: answers to reads, its own reports, and the feedback made of them. */
#include "driver/servo_can/options.h"
#include "driver/servo_can/servo_can_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Reports of position and of speed belong together when they arrive within this time. */
#define PAIR_TIME (5 * DB_NS_PER_MS)

/* Status bits and inputs are not reported unasked: interval at which a reporting drive is asked for
 * them while no command is in progress. */
#define STATUS_INTERVAL (100 * DB_NS_PER_MS)

/* True if any of these bits is active now. */
static bool has_status_bit(const struct db_device *device, uint16_t bits)
{
	return ((device->bits ^ device->status_inverted) & bits) != 0;
}

bool servo_can_is_powered(const struct db_device *device)
{
	return device->has_status && has_status_bit(device, device->enabled_bit);
}

bool servo_can_obeys_setpoint(const struct db_device *device)
{
	bool by_setpoint = device->mode == SERVO_CAN_MODE_SPEED ||
	                   device->mode == SERVO_CAN_MODE_CURRENT;

	return by_setpoint && !device->synchronous;
}

bool servo_can_stops_by_setpoint(const struct db_device *device)
{
	return servo_can_obeys_setpoint(device) && !device->stop_refused;
}

/* The drive's own bit may have its own threshold, far above standstill. */
bool servo_can_stands(const struct db_device *device)
{
	bool should_run = servo_can_is_powered(device) && device->setpoint != 0 && !device->staged;

	if (has_status_bit(device, device->moving_bit))
		return false;
	if (device->sample.speed == 0)
		return true;
	return (device->standstill_bit == 0 || has_status_bit(device, device->standstill_bit)) &&
	       !should_run && abs(device->sample.speed) <= device->standstill_speed;
}

bool servo_can_is_at_rest(const struct db_device *device)
{
	return servo_can_stands(device) && !device->going &&
	       !(servo_can_is_powered(device) && device->setpoint != 0);
}

/* Stands at its target, and shows it where it has a bit for that. */
static bool has_arrived(const struct db_device *device)
{
	return servo_can_stands(device) && servo_can_is_at(device, device->target) &&
	       (device->target_bit == 0 || has_status_bit(device, device->target_bit));
}

bool servo_can_is_at(const struct db_device *device, int32_t position)
{
	return fabs((double)device->sample.position - (double)position) <= device->window;
}

/* The error bit is in the next status, its reason only in the next report. */
bool servo_can_shows_fault(const struct db_device *device)
{
	return device->error_since != 0 &&
	       (device->error_is_fault || device->faults != 0 || !device->has_health ||
	        device->health_at < device->error_since);
}

bool servo_can_has_fault(const struct db_device *device)
{
	return device->faults != 0 || servo_can_shows_fault(device);
}

bool servo_can_lacks_max_speed(const struct db_device *device)
{
	return !isnan(device->profile.max_speed) &&
	       !(device->plate.valid[0] & PARAM_BIT(PARAM_MAX_SPEED));
}

/* --- answers to reads ------------------------------------------------------------------------- */

static void show_sample(struct db_device *device, const struct servo_can_sample *sample)
{
	/* Reports arrive while a read is in progress: time must not go back. */
	if (device->has_sample && sample->taken < device->sample.taken)
		return;
	device->sample = *sample;
	device->has_sample = true;
	(void)restart_judge(&device->restart,
	                    &(struct restart_sample){ .position = sample->position,
	                                              .stands = servo_can_stands(device),
	                                              .busy = device->going,
	                                              .power_went = device->power_fell },
	                    sample->taken);
	device->power_fell = false;
}

/*
 * True while a position move continues: until the drive rests at its target, or elsewhere for as
 * long as it may take to begin. Status bits are not used: "target reached" may only refer to the
 * reference's way.
 */
static void follow_move(struct db_device *device, db_time now)
{
	/* Power that was lost unasked, or is still to be switched on, may return. */
	if (!servo_can_is_powered(device) && device->power_taken)
		device->may_begin = false;
	/* A move that was abandoned, or whose beginning was uncertain. */
	if (!device->going && device->may_begin && device->has_target &&
	    servo_can_is_powered(device) && !servo_can_stands(device)) {
		device->going = true;
		device->may_begin = false;
	}
	if (!device->going)
		return;
	if (!servo_can_stands(device) || device->sample.position != device->seen_at) {
		device->seen_at = device->sample.position;
		device->seen_moving = now;
	}
	if (!servo_can_is_powered(device) || has_arrived(device) ||
	    now - device->seen_moving >= device->reaction)
		device->going = false;
}

static void take_status(struct db_device *device, const struct servo_can_reading *reading,
                        db_time now)
{
	bool had_power = servo_can_is_powered(device);
	bool powered;

	device->bits = reading->bits;
	device->inputs = reading->inputs;
	device->outputs = reading->outputs;
	device->status_at = now;
	device->has_status = true;
	/* The reaction to a fault begins with the bit, not with the report of its reason. */
	if (!has_status_bit(device, device->fault_bit)) {
		device->error_since = 0;
	} else if (device->error_since == 0) {
		device->error_since = now;
		device->fault_open = true;
	}
	powered = servo_can_is_powered(device);
	if (had_power && !powered && !device->power_taken) {
		device->lost_power = true;
		device->power_fell = !servo_can_shows_fault(device);
	}
	if (!had_power && powered) {
		device->power_taken = false;
		/* A fault that existed before the power was switched on counts as a new one. */
		if (servo_can_shows_fault(device))
			device->fault_open = true;
	}
	follow_move(device, now);
	if (!powered || servo_can_stands(device))
		device->stopping = false;
}

static int16_t turn_sign(int16_t steps, bool reversed)
{
	if (!reversed)
		return steps;
	return steps == INT16_MIN ? INT16_MAX : (int16_t)-steps;
}

int32_t servo_can_turn_position(const struct db_device *device, int32_t position)
{
	return device->position_reversed ? (int32_t)(0u - (uint32_t)position) : position;
}

/* Neither bit may be set at a low speed: then the way shows the direction. */
static int16_t give_sign(const struct db_device *device, const struct servo_can_reading *reading)
{
	uint16_t bits = reading->bits ^ device->status_inverted;
	bool reverse = (bits & device->reverse_bit) != 0;
	bool forward = (bits & device->forward_bit) != 0;
	int16_t speed = turn_sign(reading->speed, reading->speed < 0);

	/* A drive may have only one of the bits. */
	if (reverse == forward && device->reverse_bit != 0 && device->forward_bit != 0)
		reverse = device->has_sample && servo_can_turn_position(device, reading->position) <
		                                        device->sample.position;
	else if (device->reverse_bit == 0)
		reverse = !forward;
	return turn_sign(speed, reverse);
}

static void take_reading(struct db_device *device, unsigned parts, db_time now)
{
	const struct servo_can_reading *reading = &device->reading;

	if (parts & SERVO_CAN_GIVES_ANALOGUE) {
		device->analogue = reading->analogue;
		device->analogue_at = now;
	}
	if ((parts & SERVO_CAN_ALL_PARTS) == SERVO_CAN_ALL_PARTS)
		show_sample(
			device,
			&(struct servo_can_sample){
				.taken = reading->taken,
				.position = servo_can_turn_position(device, reading->position),
				.speed = turn_sign(device->speed_is_unsigned ?
		                                           give_sign(device, reading) :
		                                           reading->speed,
		                                   device->speed_reversed),
				.current = turn_sign(reading->current, device->current_reversed) });
	if (parts & SERVO_CAN_GIVES_STATUS)
		take_status(device, reading, now);
}

bool servo_can_take_part(struct db_device *device, unsigned sending, unsigned parts,
                         const struct servo_can_message *message, db_time now, bool *complete)
{
	static const uint8_t parts_of[SERVO_CAN_KIND_COUNT] = {
		[SERVO_CAN_ANSWER_POSITION] = SERVO_CAN_GIVES_POSITION,
		[SERVO_CAN_ANSWER_MOTION] = SERVO_CAN_GIVES_MOTION,
		[SERVO_CAN_ANSWER_STATUS] = SERVO_CAN_GIVES_STATUS,
		[SERVO_CAN_ANSWER_ANALOGUE] = SERVO_CAN_GIVES_ANALOGUE,
	};
	struct servo_can_reading *reading = &device->reading;
	unsigned part = parts_of[message->kind];

	*complete = false;
	if (reading->sending != sending)
		*reading = (struct servo_can_reading){ .sending = sending };
	if (!(part & parts))
		return false;
	reading->have |= part;
	switch (part) {
	case SERVO_CAN_GIVES_POSITION:
		reading->position = message->u.position;
		reading->taken = now;
		break;
	case SERVO_CAN_GIVES_MOTION:
		reading->speed = message->u.motion.speed;
		reading->current = message->u.motion.current;
		break;
	case SERVO_CAN_GIVES_STATUS:
		reading->bits = message->u.status.bits;
		reading->inputs = message->u.status.inputs;
		reading->outputs = message->u.status.outputs;
		break;
	default:
		reading->analogue = message->u.analogue;
		break;
	}
	if ((reading->have & parts) != parts)
		return true;
	take_reading(device, parts, now);
	/* The next read starts again, whatever its number. */
	reading->have = 0;
	*complete = true;
	return true;
}

/* --- reports ---------------------------------------------------------------------------------- */

bool servo_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                           db_time now)
{
	struct servo_can_message message;
	struct db_can_frame frame;
	db_time apart;

	if (length != sizeof(frame))
		return false;
	memcpy(&frame, bytes, sizeof(frame));
	if (servo_can_decode(&frame, &device->layout, SERVO_CAN_FROM_DRIVE, &message) !=
	    SERVO_CAN_OK)
		return false;
	switch (message.kind) {
	case SERVO_CAN_REPORT_POSITION:
		device->reported.position = servo_can_turn_position(device, message.u.position);
		device->position_at = now;
		break;
	case SERVO_CAN_REPORT_MOTION:
		device->reported.speed = turn_sign(message.u.motion.speed, device->speed_reversed);
		device->reported.current = turn_sign(message.u.motion.current,
		                                     device->current_reversed);
		device->motion_at = now;
		break;
	case SERVO_CAN_REPORT_HEALTH:
		device->voltage = message.u.health.voltage;
		device->temperature = message.u.health.temperature;
		/* The reaction to a fault is carried out once, even if the fault is gone again by
		 * then. */
		if (message.u.health.faults != 0 && device->faults == 0)
			device->fault_open = true;
		device->faults = message.u.health.faults;
		device->health_at = now;
		device->has_health = true;
		break;
	default: /* a late answer */
		return false;
	}
	/* Position and speed are sent in two reports, whose intervals are set separately. Only two
	 * that arrive together are shown, so that they belong to one moment. */
	apart = device->position_at - device->motion_at;
	if (!device->uses_reports || device->position_at == 0 || device->motion_at == 0 ||
	    apart > PAIR_TIME || apart < -PAIR_TIME)
		return true;
	device->reported.taken = device->position_at;
	device->position_at = 0;
	device->motion_at = 0;
	show_sample(device, &device->reported);
	return true;
}

/* Reports arrive as often as the bridge would ask; half a cycle more is no reason to ask. */
bool servo_can_reports_often(const struct db_device *device, db_time now)
{
	return device->has_sample && device->reported.taken != 0 &&
	       now - device->reported.taken <= device->cycle + device->cycle / 2;
}

bool servo_can_wants_poll(const struct db_device *device, db_time now)
{
	/* A short fault must not be missed while the motor runs. */
	bool busy = device->going || device->stopping || device->setpoint != 0 ||
	            device->trigger == LEVEL_HIGH || device->fault_open;

	return busy || !device->has_status || !servo_can_reports_often(device, now) ||
	       now - device->status_at >= STATUS_INTERVAL;
}

/* --- state ------------------------------------------------------------------------------------ */

static uint16_t error_of(const struct db_device *device)
{
	uint16_t bit = 0;

	if (!servo_can_has_fault(device))
		return DB_ERROR_NONE;
	if (device->faults == 0)
		return DB_ERROR_UNEXPLAINED_FAULT;
	while (!(device->faults >> bit & 1))
		bit++;
	return (uint16_t)(DB_ERROR_DRIVE_FAULT + bit);
}

static enum db_axis_state state_of(const struct db_device *device, uint16_t error)
{
	if (error != DB_ERROR_NONE)
		return DB_AXIS_ERROR_STOP;
	if (!servo_can_is_powered(device))
		return DB_AXIS_DISABLED;
	if (device->stopping)
		return DB_AXIS_STOPPING;
	if (device->going)
		return DB_AXIS_DISCRETE_MOTION;
	/* A blocked running motor counts as running. */
	if (!servo_can_stands(device) || (device->setpoint != 0 && !device->staged))
		return DB_AXIS_CONTINUOUS_MOTION;
	return DB_AXIS_STANDSTILL;
}

static uint32_t status_of(const struct db_device *device, enum db_axis_state state)
{
	uint32_t status = 0;

	if (servo_can_is_powered(device))
		status |= DB_STATUS_ENABLED;
	if (has_status_bit(device, device->homed_bit))
		status |= DB_STATUS_HOMED;
	if (!servo_can_stands(device) || device->going)
		status |= DB_STATUS_MOVING;
	if (device->has_target && !device->going && servo_can_is_powered(device) &&
	    has_arrived(device))
		status |= DB_STATUS_AT_TARGET;
	if (state == DB_AXIS_STOPPING)
		status |= DB_STATUS_STOPPING;
	if (state == DB_AXIS_ERROR_STOP)
		status |= DB_STATUS_ERROR;
	if (has_status_bit(device, device->warning_bits))
		status |= DB_STATUS_WARNING;
	if (device->params_valid)
		status |= DB_STATUS_PARAMS_VALID;
	if (device->refused)
		status |= DB_STATUS_REFUSED;
	return status;
}

void servo_can_write_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	bool known = device->has_sample && device->has_status;
	enum db_axis_state state = DB_AXIS_OFFLINE;

	feedback->taken = device->sample.taken;
	feedback->position = device->sample.position;
	feedback->velocity = (float)(device->sample.speed * device->speed_scale);
	/* With target-bit the position alone does not show that a move is done. */
	feedback->has_target = device->has_target && device->target_bit == 0;
	feedback->staged = device->staged;
	feedback->target = device->target;
	feedback->current = (float)(device->sample.current * device->current_scale);
	feedback->drive_status = device->bits;
	feedback->inputs = device->inputs;
	feedback->outputs = device->outputs;
	feedback->analogue_1 = device->analogue;
	feedback->fault_bits = device->faults;
	feedback->supply_voltage_raw = device->voltage;
	feedback->temperature_raw = device->temperature;
	/* Reported once a second, unless that was turned off in the drive. */
	feedback->supply_voltage = device->has_health ? (float)(device->voltage *
	                                                        device->options->voltage_scale) :
	                                                NAN;
	feedback->temperature = device->has_health ?
	                                (float)((int16_t)device->temperature *
	                                                device->options->temperature_scale +
	                                        device->options->temperature_offset) :
	                                NAN;
	feedback->error = error_of(device);
	if (known)
		state = state_of(device, feedback->error);
	feedback->state = (uint16_t)state;
	feedback->status = status_of(device, state);
	restart_show(&device->restart, feedback);
}

/* A commanded motion may still continue: that is not forgotten. */
static void forget_sent(struct db_device *device)
{
	device->lost_power = false;
	device->mode = device->fixed_mode;
	memset(device->setpoint_known, 0, sizeof(device->setpoint_known));
	/* A trigger that is high must still be reset. */
	if (device->trigger == LEVEL_LOW)
		device->trigger = LEVEL_NOT_KNOWN;
	if (device->plate.valid[0] != 0) {
		device->plate.valid[0] = 0;
		device->plate.generation++;
	}
}

void servo_can_take_reset(struct db_device *device)
{
	forget_sent(device);
	device->has_target = false;
	/* The profile is sent again as soon as there is time. */
	device->plate.doubtful = true;
}

void servo_can_forget_state(struct db_device *device)
{
	forget_sent(device);
	device->has_sample = false;
	device->has_status = false;
	device->has_health = false;
	device->faults = 0;
	device->reported.taken = 0;
	device->position_at = 0;
	device->motion_at = 0;
	device->analogue_at = 0;
	device->error_since = 0;
	device->params_valid = false;
	device->power_fell = false;
	restart_note_away(&device->restart);
}
