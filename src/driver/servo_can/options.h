/* SPDX-License-Identifier: Apache-2.0 */
/* Keys of the configuration, which commands they allow, and what is wrong in them. Internal to the
 * driver; pure, any thread. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_OPTIONS_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_OPTIONS_H

#include "driver/servo_can/device.h"

#define SERVO_CAN_SPEED_MAX 32767.0  /* rpm; signed 16 bits */
#define SERVO_CAN_CURRENT_MAX 3276.7 /* A; as 0.1 A in signed 16 bits */

enum servo_can_option {
	OPTION_ACK_BASE,
	OPTION_PADDED,
	OPTION_WORDS_BASE,
	OPTION_WORDS_LENGTH,
	OPTION_WORD_0_AT,
	OPTION_WORD_1_AT,
	OPTION_WORDS_FIXED,
	OPTION_WORDS_ACK,
	OPTION_CHANGE_MODE,
	OPTION_MODE,
	OPTION_TORQUE_DIRECTION,
	OPTION_SYNC,
	OPTION_REPORTS,
	OPTION_ENABLED_BIT,
	OPTION_VOLTAGE_SCALE,
	OPTION_TEMPERATURE_SCALE,
	OPTION_TEMPERATURE_OFFSET,
	OPTION_COUNTS_PER_TURN,
	OPTION_MAX_SPEED,
	OPTION_ACCELERATION,
	OPTION_DECELERATION,
	OPTION_ON_FAULT,
	OPTION_STANDSTILL_SPEED,
	OPTION_REACTION,
	OPTION_ERROR_BIT,
	OPTION_SPEED_SIGN,
	OPTION_POWER_ON_WINDOW,
	OPTION_LATE_MOVE,
	SERVO_CAN_OPTION_COUNT
};

extern const struct db_option servo_can_options[SERVO_CAN_OPTION_COUNT];

#define SERVO_CAN_POSITION_MOVES \
	(DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) | DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE))
#define SERVO_CAN_MOVES                                                    \
	(SERVO_CAN_POSITION_MOVES | DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | \
	 DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT))
/* clear_fault is among them because it is also what resets a latched loss of the client. */
#define SERVO_CAN_COMMANDS                                                                  \
	(SERVO_CAN_MOVES | DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) | \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |                  \
	 DB_COMMAND_BIT(DB_CMD_SET_POSITION) | DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) |         \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_SYNC_START))

struct servo_can_layout servo_can_read_layout(const struct db_bus_config *bus);
/* Fills in the settings of a device. */
void servo_can_configure(struct db_device *device, const struct db_bus_config *bus,
                         const struct db_drive_config *drive);
double servo_can_velocity_counts(const struct db_drive_config *drive);
uint64_t servo_can_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive);
enum db_result servo_can_check_command(const struct db_bus_config *bus,
                                       const struct db_drive_config *drive, enum db_command command,
                                       const struct db_args *args);
void servo_can_check_config(const struct db_bus_config *bus,
                            const struct db_drive_config *const *drives, size_t drive_count,
                            db_complain_fn *complain, void *context);

#endif
