/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

/* Interval at which a drive that was not online yet is looked for. */
#define FIND_INTERVAL (100 * DB_NS_PER_MS)

/* Retried soon if there is no room for a request. */
void db_commander_stand(struct db_commander *commander, enum db_command command,
                        enum db_stand_cause cause, db_time now)
{
	struct db_request *stop = commander->pending;

	commander->reaction_cause = cause;
	db_motion_stopped(commander, now);
	while (stop && !stop->reaction)
		stop = stop->next;
	if (stop) {
		/* An earlier stop that other requests have followed is repeated when it ends. */
		db_flight_stop_again(
			stop, command == DB_CMD_DISABLE ? command : db_request_stop(stop), cause);
	} else {
		stop = db_motion_submit_stop(commander, command, cause, now);
		if (!stop) {
			commander->reaction_again_at = now + DB_STOP_RETRY;
			return;
		}
		stop->reaction = true;
	}
	commander->reaction_again_at = DB_TIME_NEVER;
	db_motion_record_stop(commander, stop, command, now);
}

/*
 * A drive that moves when it is first seen was started before this program ran. Its PLC is watched
 * from now on as if it had commanded the motion here: if the PLC is gone meanwhile, the drive
 * stops.
 */
static void find_drive(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;

	if (commander->find_at > now)
		return;
	db_axis_read(commander->config.axis, &snapshot);
	if (!(snapshot.feedback.status & DB_STATUS_ONLINE)) {
		commander->find_at = now + FIND_INTERVAL;
		return;
	}
	commander->find_at = DB_TIME_NEVER;
	if (!(snapshot.feedback.status & DB_STATUS_MOVING))
		return;
	if (!commander->watchdog.armed)
		db_watchdog_arm(&commander->watchdog, now);
	/* A running program of the controller controls its own motion. */
	if (snapshot.feedback.state == DB_AXIS_CONTINUOUS_MOTION &&
	    snapshot.feedback.program_state == 0)
		db_motion_supervise(commander, DB_CMD_MOVE_VELOCITY, now);
}

/* True if it was seen standing since then, and was not commanded to move. */
static bool is_at_rest(const struct db_commander *commander, db_time since)
{
	struct db_snapshot snapshot;
	const struct db_feedback *feedback = &snapshot.feedback;

	db_axis_read(commander->config.axis, &snapshot);
	return !commander->pending && !commander->follow.active && !commander->supervise.active &&
	       (feedback->status & DB_STATUS_ONLINE) && !(feedback->status & DB_STATUS_MOVING) &&
	       feedback->taken > since &&
	       (feedback->state == DB_AXIS_STANDSTILL || feedback->state == DB_AXIS_DISABLED);
}

void db_guard_check_hold(struct db_commander *commander, db_time now)
{
	struct db_hold lost = commander->hold;

	if (now < db_hold_deadline(&commander->hold))
		return;
	db_hold_end(&commander->hold);
	commander->hold.lost = true;
	db_commander_stand(commander, commander->reaction, DB_STAND_HOLD, now);
	if (commander->ops->hold_lost)
		commander->ops->hold_lost(commander->context, &lost.holder, lost.deserted);
}

bool db_guard_run(struct db_commander *commander, db_time now)
{
	bool tripped;

	db_guard_check_hold(commander, now);
	if (now >= db_watchdog_deadline(&commander->watchdog) &&
	    db_watchdog_is_deserted(&commander->watchdog) &&
	    is_at_rest(commander, commander->watchdog.fed))
		commander->watchdog.armed = false;
	tripped = db_watchdog_trip(&commander->watchdog, now);
	/* What clears the latch before this one does not clear this one. */
	for (struct db_request *request = commander->pending; tripped && request;
	     request = request->next)
		request->ends_latch = false;
	if (tripped)
		db_commander_stand(commander, commander->reaction, DB_STAND_WATCHDOG, now);
	else if (commander->reaction_again_at <= now)
		db_commander_stand(commander, commander->reaction, commander->reaction_cause, now);
	find_drive(commander, now);
	return tripped;
}

void db_guard_unlatch(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;

	db_watchdog_reset(&commander->watchdog);
	commander->reaction_again_at = DB_TIME_NEVER;
	db_axis_read(commander->config.axis, &snapshot);
	if (snapshot.feedback.status & DB_STATUS_MOVING)
		db_watchdog_arm(&commander->watchdog, now);
}
