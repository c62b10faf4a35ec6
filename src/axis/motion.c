/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/motion.h"

#include "axis/account.h"
#include "axis/requests.h"
#include "axis/state.h"
#include "drivebridge/scale.h"

#include <math.h>

/* How often a motion under way is looked at, at most and at least. */
#define CHECK_MIN (5 * DB_NS_PER_MS)
#define CHECK_MAX (50 * DB_NS_PER_MS)

/* A drive that stands elsewhere for so many cycles, and so long, does not arrive any more. */
#define PATIENCE_CYCLES 5
#define PATIENCE_MIN (200 * DB_NS_PER_MS)

db_time db_motion_check_interval(const struct db_bus_config *bus)
{
	db_time cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;

	return cycle < CHECK_MIN ? CHECK_MIN : cycle > CHECK_MAX ? CHECK_MAX : cycle;
}

/* --- without an end ------------------------------------------------------------------------------------ */

/* What a stop of it depends on now. */
static struct db_supervise_config supervise_config(const struct db_commander *commander,
                                                   const struct db_feedback *feedback)
{
	const struct db_drive_config *drive = commander->config.drive_config;
	const struct db_driver *driver = commander->config.driver;
	double counts = db_scale_counts(drive, feedback);
	double velocity_counts = db_driver_velocity_counts(driver, drive);
	struct db_supervise_config config = {
		.min = drive->min_position * counts,
		.max = drive->max_position * counts,
		.velocity_counts = velocity_counts,
		.deceleration = (double)feedback->deceleration,
		.delay = 2 * commander->check_interval +
		         driver->command_time(commander->config.bus_config),
	};
	int param = driver->deceleration_param;
	struct db_nameplate plate;

	if (config.deceleration > 0.0 || param < 0)
		return config;
	db_axis_read_nameplate(commander->config.axis, &plate);
	if (plate.valid >> param & 1)
		config.deceleration = db_value_number(driver->params[param].type,
		                                      plate.values[param]) *
		                      velocity_counts;
	return config;
}

void db_motion_supervise(struct db_commander *commander, enum db_command command, db_time now)
{
	const struct db_drive_config *drive = commander->config.drive_config;
	struct db_supervise_config config;
	struct db_snapshot snapshot;

	if (isnan(drive->min_position) && isnan(drive->max_position))
		return;
	if (db_supervise_applies(command)) {
		db_supervise_begin(&commander->supervise, now);
		commander->check_at = now + CHECK_MIN;
	} else if (db_command_is_stop(command)) {
		db_axis_read(commander->config.axis, &snapshot);
		config = supervise_config(commander, &snapshot.feedback);
		db_supervise_stop(&commander->supervise, &config, &snapshot.feedback, now);
	} else if (db_command_is_motion(command)) {
		commander->supervise.active = false;
	}
}

/* Stops what would pass a limit otherwise. Tried again at the next look if there is no room. */
static void stop_before_limit(struct db_commander *commander, enum db_limit limit, db_time now)
{
	struct db_command_block block = { .command = DB_CMD_STOP };
	struct db_request request = {
		.command = DB_CMD_STOP,
		.submitted = now,
		.cause = DB_STAND_LIMIT,
	};
	struct db_slot *slot = db_requests_submit(commander, NULL, &request, 0);

	if (!slot) {
		commander->supervise.stopped = false;
		return;
	}
	db_motion_note_stop(commander, now);
	db_motion_note_submitted(commander, NULL, request.command, now);
	db_account_add_command(commander, NULL, &block, 0, DB_RESULT_PENDING, slot);
	commander->newest = request.ticket;
	db_writers_set_command(&commander->writers, NULL, 0, block.command, DB_RESULT_PENDING,
	                       request.ticket);
	db_writers_set_limit(&commander->writers, NULL, limit);
}

void db_motion_note_stop(struct db_commander *commander, db_time arrived)
{
	if (arrived > commander->stopped)
		commander->stopped = arrived;
}

/* --- beginning and ending -------------------------------------------------------------------------------- */

/* Whatever moved is ended by another command. Who began it is told so. */
static void cancel_motion(struct db_commander *commander, db_time now)
{
	db_writers_cancel_motion(&commander->writers);
	/* One without an end of its own has done what its command said. */
	if (commander->follow.active && db_follow_has_end(commander->follow.command))
		db_history_end(&commander->history, commander->follow_entry, DB_RESULT_CANCELLED,
		               now - commander->follow_arrived);
	commander->follow.active = false;
}

void db_motion_note_submitted(struct db_commander *commander, struct db_writer *writer,
                              enum db_command command, db_time now)
{
	if (!db_command_ends_motion(command))
		return;
	db_motion_supervise(commander, command, now);
	db_writers_ask_motion(&commander->writers, writer);
	if (!db_command_is_stop(command))
		return;
	cancel_motion(commander, now);
	/* Whoever sent it: a later motion needs a hold of its own. */
	db_hold_end(&commander->hold);
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (db_command_replaces_motion(slot->command))
			slot->overtaken = true;
	}
}

/* The drive has taken it: its result stays ok, unless the motion ends badly. */
static void begin_motion(struct db_commander *commander, struct db_writer *writer,
                         const struct db_slot *slot, db_time now)
{
	bool ends = db_follow_has_end(slot->command);

	cancel_motion(commander, now);
	if (!db_command_is_motion(slot->command))
		return;
	if (!slot->overtaken)
		db_motion_supervise(commander, slot->command, now);
	db_writers_begin_motion(&commander->writers, writer, slot->id, ends, slot->overtaken);
	if (slot->overtaken || slot->halts || !db_follow_applies(slot->command))
		return;
	db_follow_begin(&commander->follow, slot->command, slot->ticket,
	                (db_time)slot->delay * DB_NS_PER_S, now);
	commander->follow_entry = slot->entry;
	commander->follow_arrived = slot->arrived;
	commander->check_at = now + CHECK_MIN;
}

/* What the drive does now, or may do: with such a result it did not leave the command aside. */
static bool may_have_begun(enum db_result result)
{
	switch (result) {
	case DB_RESULT_OK:
	case DB_RESULT_UNPROVEN:
	case DB_RESULT_TIMEOUT:
	case DB_RESULT_INDETERMINATE:
	case DB_RESULT_FAILED:
		return true;
	default:
		return false;
	}
}

static bool is_holding_pending(const struct db_commander *commander, const struct db_slot *but)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot != but && slot->held)
			return true;
	}
	return false;
}

/* A hold is over without a stop when its motion never began, or when the drive has taken a later motion that nobody
 * holds. While that is open it goes on: who holds is then asked for one beat too many. */
static void note_hold(struct db_commander *commander, const struct db_slot *slot,
                      enum db_result result)
{
	struct db_hold *hold = &commander->hold;

	if (hold->holder.id == DB_CLIENT_NOBODY)
		return;
	if (slot->held && may_have_begun(result))
		hold->begun = true;
	else if (slot->held && !hold->begun && !is_holding_pending(commander, slot))
		db_hold_end(hold);
	else if (!slot->held && db_command_is_motion(slot->command) &&
	         db_result_is_success(result) &&
	         commander->submitted - slot->order < commander->submitted - hold->order)
		db_hold_end(hold);
}

void db_motion_note_ended(struct db_commander *commander, const struct db_slot *slot,
                          enum db_result result, db_time now)
{
	struct db_client client;
	struct db_writer *writer = db_writers_find(&commander->writers,
	                                           db_slot_client(slot, &client));

	/* The drive took it, and a stop had been handed over after it. */
	db_history_end(&commander->history, slot->entry,
	               slot->overtaken && db_result_is_success(result) &&
	                               db_command_is_motion(slot->command) ?
	                       DB_RESULT_CANCELLED :
	                       result,
	               now - slot->arrived);
	note_hold(commander, slot, result);
	if (!db_command_replaces_motion(slot->command))
		return;
	switch (result) {
	case DB_RESULT_OK:
	case DB_RESULT_UNPROVEN:
		begin_motion(commander, writer, slot, now);
		break;
	/* What the drive does now is not known. */
	case DB_RESULT_TIMEOUT:
	case DB_RESULT_INDETERMINATE:
	case DB_RESULT_FAILED:
		cancel_motion(commander, now);
		break;
	/* The command did nothing: whatever moved before goes on. */
	default:
		db_writers_refuse_motion(&commander->writers, writer);
	}
}

/* --- looking --------------------------------------------------------------------------------------------- */

/* A motion is on its way to the drive: whether the one before reaches its end is open. */
static bool motion_is_pending(const struct db_commander *commander)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (db_command_replaces_motion(slot->command))
			return true;
	}
	return false;
}

static void keep_within_limits(struct db_commander *commander, const struct db_feedback *feedback,
                               db_time now)
{
	struct db_supervise_config config;
	enum db_limit limit;

	if (!commander->supervise.active || !(feedback->status & DB_STATUS_ONLINE))
		return;
	config = supervise_config(commander, feedback);
	limit = db_supervise_check(&commander->supervise, &config, feedback, now);
	if (limit != DB_LIMIT_NONE)
		stop_before_limit(commander, limit, now);
}

static void follow_to_end(struct db_commander *commander, const struct db_feedback *feedback,
                          db_time now)
{
	const struct db_drive_config *drive = commander->config.drive_config;
	db_time cycle = (db_time)commander->config.bus_config->cycle_ms * DB_NS_PER_MS;
	db_time patience = PATIENCE_CYCLES * cycle;
	struct db_follow_config config = {
		.window = drive->in_position_window * drive->counts_per_unit,
		.settling = (db_time)drive->settling_ms * DB_NS_PER_MS,
		.patience = patience < PATIENCE_MIN ? PATIENCE_MIN : patience,
	};
	enum db_result result;

	if (!commander->follow.active || motion_is_pending(commander))
		return;
	result = db_follow_check(&commander->follow, &config, feedback, now);
	if (result == DB_RESULT_PENDING)
		return;
	db_history_end(&commander->history, commander->follow_entry, result,
	               now - commander->follow_arrived);
	db_writers_end_motion(&commander->writers, commander->follow.ticket, result);
	/* It stands at its end, and there is nothing to be held. */
	if (result == DB_RESULT_OK)
		db_hold_end(&commander->hold);
}

void db_motion_check(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;

	if (db_motion_deadline(commander) > now)
		return;
	commander->check_at = now + commander->check_interval;
	db_axis_read(commander->config.axis, &snapshot);
	keep_within_limits(commander, &snapshot.feedback, now);
	follow_to_end(commander, &snapshot.feedback, now);
}

db_time db_motion_deadline(const struct db_commander *commander)
{
	return commander->follow.active || commander->supervise.active ? commander->check_at :
	                                                                 DB_TIME_NEVER;
}
