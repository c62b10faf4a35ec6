/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/servo_view.h"

#include "sim/servo_state.h"

void sim_servo_force_status(struct sim_servo *drive, uint16_t bits)
{
	drive->forced = bits;
}

void sim_servo_set_health(struct sim_servo *drive, uint16_t voltage, uint16_t temperature)
{
	drive->voltage = voltage;
	drive->temperature = temperature;
}

void sim_servo_set_inputs(struct sim_servo *drive, uint8_t inputs, uint16_t analogue)
{
	drive->inputs = inputs;
	drive->analogue = analogue;
}

bool sim_servo_ignores_broadcast(const struct sim_servo *drive)
{
	return drive->config.temper.ignores_broadcast;
}

bool sim_servo_powered(const struct sim_servo *drive)
{
	return drive->powered;
}

enum servo_can_mode sim_servo_mode(const struct sim_servo *drive)
{
	return drive->mode;
}

bool sim_servo_enabled(const struct sim_servo *drive)
{
	return drive->enabled;
}

double sim_servo_position(const struct sim_servo *drive)
{
	return drive->position;
}

double sim_servo_speed(const struct sim_servo *drive)
{
	return drive->rpm;
}

double sim_servo_current(const struct sim_servo *drive)
{
	return drive->amperes;
}

db_time sim_servo_setpoint_at(const struct sim_servo *drive)
{
	return drive->setpoint_at;
}

uint32_t sim_servo_count(const struct sim_servo *drive, enum servo_can_kind kind)
{
	return drive->counts[kind];
}

uint32_t sim_servo_moves(const struct sim_servo *drive)
{
	return drive->moves;
}
