/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/follow.h"

#include <math.h>

bool db_follow_applies(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
	case DB_CMD_HOME:
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return true;
	default:
		return false;
	}
}

void db_follow_begin(struct db_follow *follow, enum db_command command, uint32_t ticket,
                     db_time now)
{
	*follow = (struct db_follow){
		.active = true,
		.command = command,
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

enum db_result db_follow_check(struct db_follow *follow, const struct db_follow_config *config,
                               const struct db_feedback *feedback, db_time now)
{
	enum db_result result;

	if (!(feedback->status & DB_STATUS_ONLINE))
		result = DB_RESULT_INDETERMINATE;
	else if (feedback->taken <= follow->since)
		result = DB_RESULT_PENDING;
	else if (feedback->state == DB_AXIS_ERROR_STOP)
		result = DB_RESULT_FAILED;
	else if (feedback->state == DB_AXIS_DISABLED)
		result = DB_RESULT_CANCELLED;
	else if (follow->command == DB_CMD_HOME)
		result = check_homing(feedback);
	else if (follow->command == DB_CMD_SHAKE_START ||
	         follow->command == DB_CMD_SHAKE_START_TIME)
		result = check_shake(follow, config, feedback, now);
	else
		result = check_move(follow, config, feedback, now);
	if (result != DB_RESULT_PENDING)
		follow->active = false;
	return result;
}
