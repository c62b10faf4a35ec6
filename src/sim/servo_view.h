/* SPDX-License-Identifier: Apache-2.0 */
/* A simulated servo's state for tests, and values that tests let it show. One thread, as
 * servo_drive.h. */
#ifndef DRIVEBRIDGE_SIM_SERVO_VIEW_H
#define DRIVEBRIDGE_SIM_SERVO_VIEW_H

#include "sim/servo_drive.h"

/* Shows these status bits in addition to the real ones. */
void sim_servo_force_status(struct sim_servo *drive, uint16_t bits);
void sim_servo_set_health(struct sim_servo *drive, uint16_t voltage, uint16_t temperature);
void sim_servo_set_inputs(struct sim_servo *drive, uint8_t inputs, uint16_t analogue);

/* State for tests. Call sim_servo_advance() before. */
bool sim_servo_ignores_broadcast(const struct sim_servo *drive);
bool sim_servo_powered(const struct sim_servo *drive);
enum servo_can_mode sim_servo_mode(const struct sim_servo *drive);
bool sim_servo_enabled(const struct sim_servo *drive);
double sim_servo_position(const struct sim_servo *drive); /* counts, as fed back */
double sim_servo_speed(const struct sim_servo *drive);    /* rpm */
double sim_servo_current(const struct sim_servo *drive);  /* A */
/* When speed or current last came into force; the skew of a synchronous start is the difference of
 * two drives' times. */
db_time sim_servo_setpoint_at(const struct sim_servo *drive);

/* How often it received a message of this kind, and how often a position move began. */
uint32_t sim_servo_count(const struct sim_servo *drive, enum servo_can_kind kind);
uint32_t sim_servo_moves(const struct sim_servo *drive);

#endif
