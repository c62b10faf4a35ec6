/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/reaction.h"

#include "axis/account.h"
#include "axis/motion.h"
#include "axis/requests.h"
#include "axis/state.h"

/* How often a drive that was not there yet is looked for. */
#define FIND_INTERVAL (100 * DB_NS_PER_MS)

/* The same for every cause, so that one never weakens what another has asked for. Without
 * on-client-loss there is no watchdog; what is held is stopped all the same. */
static enum db_command reaction_command(const struct db_commander *commander)
{
	enum db_command command = commander->config.on_client_loss;

	return command != DB_CMD_NONE ? command : DB_CMD_STOP;
}

/* Tried again soon if there is no room for a request. */
void db_reaction_stand(struct db_commander *commander, enum db_command command,
                       enum db_stand_cause cause, db_time now)
{
	struct db_command_block block = { .command = (uint16_t)command };
	struct db_request request = { .command = command, .cause = cause, .submitted = now };
	struct db_slot *slot = commander->pending.first;

	commander->reaction_cause = cause;
	db_motion_note_stop(commander, now);
	while (slot && !slot->reaction)
		slot = slot->next;
	if (slot) {
		/* One of an earlier time, with what came since behind it, is repeated when it
		 * ends. */
		slot->again = true;
		slot->cause = cause;
		if (command == DB_CMD_DISABLE)
			slot->command = command;
	} else {
		slot = db_requests_submit(commander, NULL, &request, 0);
		if (!slot) {
			commander->reaction_again_at = now + DB_STOP_RETRY;
			return;
		}
		slot->reaction = true;
	}
	commander->reaction_again_at = DB_TIME_NEVER;
	db_motion_note_submitted(commander, NULL, slot->command, now);
	/* Of one that repeats what is still with the bus there is an entry. */
	if (slot->entry != 0)
		db_history_repeat(&commander->history, slot->entry);
	else
		db_account_add_command(commander, NULL, &block, 0, DB_RESULT_PENDING, slot);
	commander->newest = slot->ticket;
	db_writers_set_command(&commander->writers, NULL, 0, block.command, DB_RESULT_PENDING,
	                       slot->ticket);
}

/*
 * A drive that moves when it is first seen was set going before this program ran. Its PLC is
 * watched from now on as if it had commanded the motion here: should it have gone meanwhile, the
 * drive stops.
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
	/* A running program of the controller's has its own way. */
	if (snapshot.feedback.state == DB_AXIS_CONTINUOUS_MOTION &&
	    snapshot.feedback.program_state == 0)
		db_motion_supervise(commander, DB_CMD_MOVE_VELOCITY, now);
}

/* Seen to stand since then, and not told to move. */
static bool is_at_rest(const struct db_commander *commander, db_time since)
{
	struct db_snapshot snapshot;
	const struct db_feedback *feedback = &snapshot.feedback;

	db_axis_read(commander->config.axis, &snapshot);
	return !commander->pending.first && !commander->follow.active &&
	       !commander->supervise.active && (feedback->status & DB_STATUS_ONLINE) &&
	       !(feedback->status & DB_STATUS_MOVING) && feedback->taken > since &&
	       (feedback->state == DB_AXIS_STANDSTILL || feedback->state == DB_AXIS_DISABLED);
}

void db_reaction_check_hold(struct db_commander *commander, db_time now)
{
	struct db_hold lost = commander->hold;

	if (now < db_hold_deadline(&commander->hold))
		return;
	db_hold_lose(&commander->hold);
	db_reaction_stand(commander, reaction_command(commander), DB_STAND_HOLD, now);
	if (commander->ops->hold_lost)
		commander->ops->hold_lost(commander->context, &lost.holder, lost.deserted);
}

bool db_reaction_run(struct db_commander *commander, db_time now)
{
	bool tripped;

	db_reaction_check_hold(commander, now);
	if (now >= db_watchdog_deadline(&commander->watchdog) &&
	    db_watchdog_is_deserted(&commander->watchdog) &&
	    is_at_rest(commander, commander->watchdog.fed))
		db_watchdog_disarm(&commander->watchdog);
	tripped = db_watchdog_trip(&commander->watchdog, now);
	if (tripped)
		db_reaction_stand(commander, reaction_command(commander), DB_STAND_WATCHDOG, now);
	else if (commander->reaction_again_at <= now)
		db_reaction_stand(commander, reaction_command(commander), commander->reaction_cause,
		                  now);
	db_requests_repeat_stops(commander, now);
	find_drive(commander, now);
	return tripped;
}

db_time db_reaction_deadline(const struct db_commander *commander)
{
	db_time next = db_watchdog_deadline(&commander->watchdog);

	if (db_hold_deadline(&commander->hold) < next)
		next = db_hold_deadline(&commander->hold);
	if (commander->reaction_again_at < next)
		next = commander->reaction_again_at;
	return commander->find_at < next ? commander->find_at : next;
}

void db_reaction_forget_hold(struct db_commander *commander)
{
	if (commander->reaction_cause != DB_STAND_HOLD)
		return;
	commander->reaction_again_at = DB_TIME_NEVER;
}

void db_reaction_unlatch(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;

	db_watchdog_reset(&commander->watchdog);
	commander->reaction_again_at = DB_TIME_NEVER;
	db_axis_read(commander->config.axis, &snapshot);
	if (snapshot.feedback.status & DB_STATUS_MOVING)
		db_watchdog_arm(&commander->watchdog, now);
}
