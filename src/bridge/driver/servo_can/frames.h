/* SPDX-License-Identifier: Apache-2.0 */
/* Frames to the drive, as exchanges. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_FRAMES_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_FRAMES_H

#include "driver/conversation.h"
#include "driver/servo_can/servo_can_private.h"

/* The frame sent last in a conversation. */
enum servo_can_step {
	STEP_READ, /* a read of all parts, or of the status */
	STEP_ANALOGUE,
	STEP_MODE, /* mode and maximum speed */
	STEP_CLEAR_SPEED,
	STEP_CLEAR_CURRENT,
	STEP_SETPOINT,
	STEP_DEMAND, /* the internal position; nothing is to move */
	STEP_TARGET, /* the internal position, for the rise of CTRG that follows */
	STEP_TRIGGER_DOWN,
	STEP_TRIGGER_UP,
	STEP_WORDS,
	STEP_POWER,
	STEP_FEEDBACK,
	STEP_SYNC,
	STEP_RAMPS,
	STEP_WORD_1,  /* where the word has its own frame */
	STEP_MOVE,    /* the frame that starts a move by itself */
	STEP_LOAD,    /* a rise of CTRG without power, for the demand */
	STEP_RETREAT, /* power off, because of a motion that might still begin */
};

static inline struct servo_can_progress *progress_of(const struct db_conversation *talk)
{
	const struct db_job *job = talk->job;
	enum servo_can_lane lane = job->kind == DB_JOB_POLL ? LANE_POLLS :
	                           job->kind != DB_JOB_COMMAND && job->kind != DB_JOB_SETTINGS ?
	                                                      LANE_IDENTIFIES :
	                           job->kind == DB_JOB_COMMAND &&
	                                           db_command_is_stop(job->request->command) ?
	                                                      LANE_STOPS :
	                                                      LANE_REQUESTS;

	return &talk->device->progress[lane];
}

/* True if the step was acknowledged in this conversation, or skipped. */
static inline bool is_done(const struct db_conversation *talk, enum servo_can_step step)
{
	return (progress_of(talk)->done >> step & 1) != 0;
}

unsigned servo_can_count_bits(unsigned bits);
/* `parts` must be a set that a selector can read. */
enum db_step servo_can_read_parts(struct db_conversation *talk, enum servo_can_step step,
                                  unsigned parts);
enum db_step servo_can_read_all(struct db_conversation *talk);
/* Includes the profile's maximum speed, if the drive does not have it yet, or has another one. */
enum db_step servo_can_send_mode(struct db_conversation *talk, enum servo_can_mode mode,
                                 const uint16_t *max_speed);
/* A speed 0 or current 0 for any mode of the drive. */
enum db_step servo_can_send_clear(struct db_conversation *talk, enum servo_can_kind kind);
/* In the units of the drive's mode. */
enum db_step servo_can_send_setpoint(struct db_conversation *talk, int16_t setpoint);
enum db_step servo_can_send_power(struct db_conversation *talk, bool on);
/* Switches the power off, so that nothing of this command can begin any more. */
enum db_step servo_can_send_retreat(struct db_conversation *talk);
/* Raises CTRG while the motor has no power: some drives accept a demand only then. */
enum db_step servo_can_send_load(struct db_conversation *talk);
/* With the command words held. */
enum db_step servo_can_send_trigger(struct db_conversation *talk, bool up);
/* Leaves CTRG unchanged. */
enum db_step servo_can_send_words(struct db_conversation *talk, const uint16_t words[2]);
/* Only where the word has its own frame. */
enum db_step servo_can_send_word_1(struct db_conversation *talk, uint16_t word);
/* Moves by the frame that starts a move by itself; ends the job where the way cannot be expressed.
 * `step`: STEP_MOVE, or STEP_DEMAND, where nothing is to move. */
enum db_step servo_can_send_move(struct db_conversation *talk, enum servo_can_step step,
                                 int32_t target);
/* STEP_DEMAND and STEP_TARGET: the internal position; STEP_FEEDBACK: the position itself. */
enum db_step servo_can_send_position(struct db_conversation *talk, enum servo_can_step step,
                                     int32_t position);
enum db_step servo_can_send_sync(struct db_conversation *talk);
enum db_step servo_can_send_ramps(struct db_conversation *talk, uint32_t acceleration,
                                  uint32_t deceleration);
/* See db_driver.interrupt. */
bool servo_can_write_interrupt(struct db_device *device, enum db_command command,
                               struct db_exchange *exchange);

#endif
