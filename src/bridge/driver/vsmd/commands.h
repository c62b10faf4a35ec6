/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What neutral commands mean to VSMD drives on every bus, and how they are carried out. Internal to
 * the driver; bus thread only, except vsmd_check_command() and vsmd_command_of(), which are pure.
 *
 * A relative move is turned into an absolute one from a freshly read position, so that a lost
 * answer can never make the drive move twice. Commands that start a motion are not repeated blindly
 * either: after a lost answer the drive is read back, and only when it demonstrably did not react
 * (it stood and still stands where it was) is the command sent again.
 *
 * An answer proves that a command arrived, not that it had an effect: a command is done when a
 * reading after it shows its effect, and no older motion explains that (effect.h). The effect is
 * awaited for the drive's reaction time. An effect that a drive does not show ends as unproven.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_COMMANDS_H
#define DRIVEBRIDGE_DRIVER_VSMD_COMMANDS_H

#include "driver/vsmd/vsmd_private.h"

#define VSMD_COMMANDS                                                                   \
	(DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |               \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |              \
	 DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) |  \
	 DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE) | DB_COMMAND_BIT(DB_CMD_HOME) |           \
	 DB_COMMAND_BIT(DB_CMD_HOME_STOP) | DB_COMMAND_BIT(DB_CMD_SET_POSITION) |       \
	 DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) | DB_COMMAND_BIT(DB_CMD_SAVE_PARAMETERS) |  \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_MOVE_PRESET) |  \
	 DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS) |       \
	 DB_COMMAND_BIT(DB_CMD_SET_SV) | DB_COMMAND_BIT(DB_CMD_SET_NMOS) |              \
	 DB_COMMAND_BIT(DB_CMD_SHAKE_START) | DB_COMMAND_BIT(DB_CMD_SHAKE_START_TIME) | \
	 DB_COMMAND_BIT(DB_CMD_SHAKE_STOP))

/* job->step of a command that is carried out here. */
enum vsmd_step {
	VSMD_STEP_ORDER,       /* the command itself; repeated reads until its effect shows */
	VSMD_STEP_POSITION,    /* before move_relative: the position it counts from */
	VSMD_STEP_CLEAR_HOMED, /* before home: the end of the previous homing is cleared */
	VSMD_STEP_OUTPUT,      /* for set_outputs: one port after the other */
	VSMD_STEP_STOP, /* for stop and quick_stop; `stp` ends velocity and position moves ... */
	VSMD_STEP_END_HOMING,  /* ... homing has its own end ... */
	VSMD_STEP_END_SHAKING, /* ... and so has shaking */
	VSMD_STEP_OFF,         /* for disable */
	VSMD_STEP_POWER,       /* ... read until it shows */
	VSMD_STEP_SAVE,
	VSMD_STEP_READ_BACK, /* an answer was lost: the drive itself is read */
	VSMD_STEPS
};

/* Checks the documented ranges. */
enum db_result vsmd_check_command(const struct vsmd_link *link, enum db_command command,
                                  const struct db_args *args);

/* The one command that carries out a neutral one; a status request where it takes several. */
struct vsmd_command vsmd_command_of(enum db_command command, const struct db_args *args);

/* True for a command that is carried out here: all but read_parameters, which the links handle. */
bool vsmd_is_command(const struct db_job *job);
enum db_step vsmd_begin_command(struct db_conversation *talk);
/* By enum vsmd_step. `answered` is called when the status in the answer was taken. */
extern const struct conversation_step vsmd_command_steps[VSMD_STEPS];
/* The motion of the exchange was started on all drives at once: checks whether it shows. */
enum db_step vsmd_begun_by_all(struct db_conversation *talk);

#endif
