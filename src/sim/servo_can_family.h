/* SPDX-License-Identifier: Apache-2.0 */
/* Simulated servo drives, as the world and the control commands see them. One thread. */
#ifndef DRIVEBRIDGE_SIM_SERVO_CAN_FAMILY_H
#define DRIVEBRIDGE_SIM_SERVO_CAN_FAMILY_H

#include "sim/family.h"

extern const struct sim_family sim_servo_can_family;

#endif
