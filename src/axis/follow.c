/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/follow.h"

#include <math.h>

static bool is_endless(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_PRESET:
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
		return true;
	default: /* a motor with a current may stand against something */
		return false;
	}
}

static bool is_program(enum db_command command)
{
	return command == DB_CMD_START_PROGRAM || command == DB_CMD_CONTINUE_PROGRAM;
}

bool db_follow_has_end(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
	case DB_CMD_HOME:
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return true;
	default:
		return is_program(command);
	}
}

bool db_follow_applies(enum db_command command)
{
	return db_follow_has_end(command) || is_endless(command);
}

void db_follow_begin(struct db_follow *follow, enum db_command command, uint32_t ticket,
                     db_time delay, db_time now)
{
	*follow = (struct db_follow){
		.active = true,
		.command = command,
		.delay = delay,
		.ticket = ticket,
		.since = now,
	};
}

static enum db_result check_homing(const struct db_feedback *feedback)
{
	if (feedback->state == DB_AXIS_HOMING || (feedback->status & DB_STATUS_MOVING))
		return DB_RESULT_PENDING;
	return feedback->status & DB_STATUS_HOMED ? DB_RESULT_OK : DB_RESULT_FAILED;
}

static enum db_result check_move(struct db_follow *follow, const struct db_follow_config *config,
                                 const struct db_feedback *feedback, db_time now)
{
	double distance = fabs((double)feedback->position - (double)feedback->target);
	/* Where the target is known, the position decides, whatever a bit of the drive's says. */
	bool there = feedback->has_target ? distance <= config->window :
	                                    (feedback->status & DB_STATUS_AT_TARGET) != 0;

	if (feedback->status & DB_STATUS_MOVING) {
		follow->standing_since = follow->there_since = 0;
		return DB_RESULT_PENDING;
	}
	if (follow->standing_since == 0)
		follow->standing_since = now;
	if (!there) {
		follow->there_since = 0;
		return now - follow->standing_since >= config->patience ? DB_RESULT_FAILED :
		                                                          DB_RESULT_PENDING;
	}
	if (follow->there_since == 0)
		follow->there_since = now;
	return now - follow->there_since >= config->settling ? DB_RESULT_OK : DB_RESULT_PENDING;
}

/* The first status may still stand; a short shake may be over before it was seen to move. */
static enum db_result check_shake(struct db_follow *follow, const struct db_follow_config *config,
                                  const struct db_feedback *feedback, db_time now)
{
	if (feedback->status & DB_STATUS_MOVING) {
		follow->moved = true;
		return DB_RESULT_PENDING;
	}
	return follow->moved || now - follow->since >= config->patience ? DB_RESULT_OK :
	                                                                  DB_RESULT_PENDING;
}

/* It is ended by another command only, which is followed instead: one that stands by itself was stopped by
 * something. Between two directions it may be seen to stand for a moment. */
static enum db_result check_endless(struct db_follow *follow, const struct db_follow_config *config,
                                    const struct db_feedback *feedback, db_time now)
{
	bool stands = !(feedback->status & DB_STATUS_MOVING) &&
	              (feedback->state == DB_AXIS_STANDSTILL ||
	               feedback->state == DB_AXIS_DISABLED);

	if (!stands) {
		follow->moved = true;
		follow->standing_since = 0;
		return DB_RESULT_PENDING;
	}
	/* One that waits for a common start stands until then. */
	if (!follow->moved)
		return DB_RESULT_PENDING;
	if (follow->standing_since == 0)
		follow->standing_since = now;
	return now - follow->standing_since >= config->patience ? DB_RESULT_FAILED :
	                                                          DB_RESULT_PENDING;
}

/* Whether its axes move or stand in between says nothing: it may wait for an input. */
static enum db_result check_program(struct db_follow *follow, const struct db_follow_config *config,
                                    const struct db_feedback *feedback, db_time now)
{
	bool begun = follow->moved || now - follow->since >= follow->delay + config->patience;

	switch (feedback->program_state) {
	case DB_PROGRAM_IDLE:
		if (!begun)
			return DB_RESULT_PENDING;
		/* One with a delay may have been called off. */
		return follow->moved || follow->delay == 0 ? DB_RESULT_OK : DB_RESULT_INDETERMINATE;
	case DB_PROGRAM_WAITING:
		return DB_RESULT_CANCELLED;
	case DB_PROGRAM_UNTOLD:
		return begun ? DB_RESULT_INDETERMINATE : DB_RESULT_PENDING;
	default:
		follow->moved = true;
		return DB_RESULT_PENDING;
	}
}

static enum db_result check(struct db_follow *follow, const struct db_follow_config *config,
                            const struct db_feedback *feedback, db_time now)
{
	if (!(feedback->status & DB_STATUS_ONLINE))
		return is_endless(follow->command) ? DB_RESULT_PENDING : DB_RESULT_INDETERMINATE;
	if (feedback->taken <= follow->since)
		return DB_RESULT_PENDING;
	if (feedback->state == DB_AXIS_ERROR_STOP)
		return DB_RESULT_FAILED;
	if (is_endless(follow->command))
		return check_endless(follow, config, feedback, now);
	if (is_program(follow->command))
		return check_program(follow, config, feedback, now);
	if (feedback->state == DB_AXIS_DISABLED)
		return DB_RESULT_CANCELLED;
	if (follow->command == DB_CMD_HOME)
		return check_homing(feedback);
	if (follow->command == DB_CMD_SHAKE_START || follow->command == DB_CMD_SHAKE_START_TIME)
		return check_shake(follow, config, feedback, now);
	return check_move(follow, config, feedback, now);
}

enum db_result db_follow_check(struct db_follow *follow, const struct db_follow_config *config,
                               const struct db_feedback *feedback, db_time now)
{
	enum db_result result = check(follow, config, feedback, now);

	if (result != DB_RESULT_PENDING)
		follow->active = false;
	return result;
}
