/* SPDX-License-Identifier: Apache-2.0 */
/* Keys of the configuration, the commands that they allow, and checks of them. Internal to the
 * driver; pure, any thread. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_OPTIONS_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_OPTIONS_H

#include "driver/servo_can/servo_can_private.h"

#define SERVO_CAN_STEPS_MAX 32767.0 /* range of a speed or current: signed 16 bits */

/* Settings of a bus, named as their keys. NAN: not given. Words are numbered as they are listed. */
struct servo_can_bus_options {
	double ack_base;
	unsigned padded; /* no, yes */
	double command_word_base;
	double command_word_length;
	double command_word_0_at;
	double command_word_1_at;
	double command_word_fixed;
	double command_word_ack;
	double command_word_1_base;
	double command_word_1_length;
	double command_word_1_fixed;
	double command_word_1_ack;
	double position_slot;
	double position_slot_base;
	double position_slot_ack;
	double move_frame_base;
	double move_frame_length;
	double move_frame_at;
	double move_frame_bytes;
	unsigned move_frame_order; /* high-first, low-first */
	double move_frame_fixed;
	double move_frame_ack;
	unsigned move_frame_target; /* absolute, relative */
	double move_frame_scale;
};

/* Settings of a drive, named as their keys. NAN: not given. Words are numbered in the order of
 * their list. */
struct servo_can_drive_options {
	unsigned allow_mode_change; /* no, yes */
	unsigned mode;              /* unknown, position, speed, current */
	unsigned torque_direction;  /* counterclockwise, clockwise */
	unsigned sync;              /* no, yes */
	unsigned reports;           /* use, ignore */
	double enabled_bit;
	double voltage_scale;
	double temperature_scale;
	double temperature_offset;
	double counts_per_turn;
	double max_speed;
	double ramp_acceleration;
	double ramp_deceleration;
	unsigned on_fault; /* none, stop, disable */
	double standstill_speed;
	double reaction_ms;
	unsigned error_bit;  /* fault, alarm */
	unsigned speed_sign; /* signed, bits */
	double power_on_window;
	unsigned late_move; /* disable, follow */
	double fault_bit;
	double standstill_bit;
	double moving_bit;
	double target_bit;
	double homed_bit;
	double warning_bit;
	double overload_bit;
	double limit_bit;
	double reverse_bit;
	double forward_bit;
	double status_inverted;
	unsigned position_sign; /* normal, reversed */
	double position_command_scale;
	double speed_scale;
	double speed_command_scale;
	double current_scale;
	double current_command_scale;
};

#define SERVO_CAN_OPTION_COUNT 61
extern const struct db_option servo_can_options[SERVO_CAN_OPTION_COUNT];

#define SERVO_CAN_POSITION_MOVES \
	(DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) | DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE))
#define SERVO_CAN_MOVES                                                    \
	(SERVO_CAN_POSITION_MOVES | DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | \
	 DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT))
/* clear_fault is among them because it also resets a latched loss of the client. */
#define SERVO_CAN_COMMANDS                                                                  \
	(SERVO_CAN_MOVES | DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) | \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |                  \
	 DB_COMMAND_BIT(DB_CMD_SET_POSITION) | DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) |         \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_SYNC_START))

struct servo_can_layout servo_can_read_layout(const struct db_bus_config *bus);
/* Fills in the settings of a device; see db_driver.init. There is one drive per address. */
void servo_can_configure(struct db_device *device, struct db_device *first,
                         const struct db_bus_config *bus, const struct db_drive_config *drive);
double servo_can_velocity_counts(const struct db_drive_config *drive);
uint64_t servo_can_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive);
enum db_result servo_can_check_command(const struct db_bus_config *bus,
                                       const struct db_drive_config *drive, enum db_command command,
                                       const struct db_args *args);
void servo_can_check_config(const struct db_bus_config *bus,
                            const struct db_drive_config *const *drives, size_t drive_count,
                            db_complain_fn *complain, void *context);

#endif
