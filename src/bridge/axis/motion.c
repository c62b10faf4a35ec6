/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include "drivebridge/scale.h"

#include <math.h>

enum db_motion db_motion_of(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_PRESET:
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
		return DB_MOTION_ENDLESS;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		return DB_MOTION_MOVE;
	case DB_CMD_HOME:
		return DB_MOTION_HOME;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return DB_MOTION_SHAKE;
	case DB_CMD_START_PROGRAM:
	case DB_CMD_CONTINUE_PROGRAM:
		return DB_MOTION_PROGRAM;
	default: /* a motor with current may stand against an obstacle */
		return DB_MOTION_NONE;
	}
}

/* A speed counts as reached within a twentieth of it, in this number of samples in a row; and only
 * if it differs from the previous speed by twice that. */
#define NEAR_SHARE 0.05f
#define NEAR_SAMPLES 3

static bool is_near(float velocity, float speed, float share)
{
	return fabsf(velocity - speed) <= share * fabsf(speed);
}

void db_follow_begin(struct db_follow *follow, const struct db_request *request, bool proven,
                     db_time now)
{
	enum db_command command = request->command;

	*follow = (struct db_follow){
		.active = true,
		.command = command,
		.unproven = !proven,
		.ticket = request->ticket,
		.since = now,
	};
	if (command == DB_CMD_START_PROGRAM)
		follow->delay = (db_time)request->args->program_delay * DB_NS_PER_S;
	if (command == DB_CMD_MOVE_VELOCITY && !proven &&
	    !is_near(request->before, request->args->target_velocity, 2.0f * NEAR_SHARE))
		follow->speed = request->args->target_velocity;
}

bool db_follow_shows(struct db_follow *follow, const struct db_feedback *feedback)
{
	if (fpclassify(follow->speed) == FP_ZERO || !(feedback->status & DB_STATUS_ONLINE) ||
	    feedback->taken <= follow->since || feedback->taken <= follow->sampled)
		return false;
	follow->sampled = feedback->taken;
	follow->near = is_near(feedback->velocity, follow->speed, NEAR_SHARE) ? follow->near + 1 :
	                                                                        0;
	if (follow->near < NEAR_SAMPLES)
		return false;
	follow->speed = 0.0f;
	return true;
}

bool db_follow_is_late(struct db_follow *follow, const struct db_feedback *feedback)
{
	if (!follow->late || !(feedback->status & DB_STATUS_ONLINE) ||
	    !(feedback->status & DB_STATUS_HOMED) || (feedback->status & DB_STATUS_MOVING))
		return false;
	follow->late = false;
	return true;
}

static enum db_result check_move(struct db_follow *follow, const struct db_follow_config *config,
                                 const struct db_feedback *feedback, db_time now)
{
	double distance = fabs((double)feedback->position - (double)feedback->target);
	/* Where the target is known, the position decides, whatever a status bit of the drive
	 * shows, unless the drive's configuration asks for such a bit in addition. */
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

/* It is ended only by another command, which is followed instead: a drive that stands by itself was
 * stopped by something. Between two directions it may be seen standing for a moment. */
static enum db_result check_endless(struct db_follow *follow, const struct db_follow_config *config,
                                    const struct db_feedback *feedback, db_time now)
{
	bool stands = !(feedback->status & DB_STATUS_MOVING) &&
	              (feedback->state == DB_AXIS_STANDSTILL ||
	               feedback->state == DB_AXIS_DISABLED);

	/* It was accepted without proof: its position is the proof, for a drive whose state shows
	 * that it runs, too. A motion that waits for a common start stands until then. */
	if (follow->unproven && !follow->moved) {
		if (feedback->staged)
			return DB_RESULT_PENDING;
		if (!follow->has_first)
			follow->first = feedback->position;
		follow->has_first = true;
		follow->moved = (feedback->status & DB_STATUS_MOVING) ||
		                fabs((double)feedback->position - (double)follow->first) >
		                        config->window;
		return !follow->moved && now - follow->since >= config->reaction ?
		               DB_RESULT_FAILED :
		               DB_RESULT_PENDING;
	}
	if (!stands) {
		follow->moved = true;
		follow->standing_since = 0;
		return DB_RESULT_PENDING;
	}
	if (!follow->moved)
		return DB_RESULT_PENDING;
	if (follow->standing_since == 0)
		follow->standing_since = now;
	return now - follow->standing_since >= config->patience ? DB_RESULT_FAILED :
	                                                          DB_RESULT_PENDING;
}

/* Whether the program's axes move or stand in between shows nothing: it may wait for an input. */
static enum db_result check_program(struct db_follow *follow, const struct db_follow_config *config,
                                    const struct db_feedback *feedback, db_time now)
{
	bool begun = follow->moved || now - follow->since >= follow->delay + config->patience;

	switch (feedback->program_state) {
	case DB_PROGRAM_IDLE:
		if (!begun)
			return DB_RESULT_PENDING;
		/* A program with a delay may have been called off. */
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

/* A short shake may be over before it was seen to move, and the first status may still show
 * standstill. */
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

static enum db_result check(struct db_follow *follow, const struct db_follow_config *config,
                            const struct db_feedback *feedback, db_time now)
{
	enum db_motion motion = db_motion_of(follow->command);

	if (!(feedback->status & DB_STATUS_ONLINE))
		return motion == DB_MOTION_ENDLESS ? DB_RESULT_PENDING : DB_RESULT_INDETERMINATE;
	if (feedback->taken <= follow->since)
		return DB_RESULT_PENDING;
	if (feedback->state == DB_AXIS_ERROR_STOP)
		return DB_RESULT_FAILED;
	if (motion == DB_MOTION_ENDLESS)
		return check_endless(follow, config, feedback, now);
	if (motion == DB_MOTION_PROGRAM)
		return check_program(follow, config, feedback, now);
	if (feedback->state == DB_AXIS_DISABLED)
		return DB_RESULT_CANCELLED;
	if (motion == DB_MOTION_SHAKE)
		return check_shake(follow, config, feedback, now);
	if (motion != DB_MOTION_HOME)
		return check_move(follow, config, feedback, now);
	if (feedback->state == DB_AXIS_HOMING || (feedback->status & DB_STATUS_MOVING))
		return DB_RESULT_PENDING;
	return feedback->status & DB_STATUS_HOMED ? DB_RESULT_OK : DB_RESULT_FAILED;
}

enum db_result db_follow_check(struct db_follow *follow, const struct db_follow_config *config,
                               const struct db_feedback *feedback, db_time now)
{
	enum db_result result = check(follow, config, feedback, now);

	if (result == DB_RESULT_PENDING)
		return result;
	follow->active = false;
	/* A drive without power, or with a fault, finds no origin. */
	follow->late = follow->command == DB_CMD_HOME && result == DB_RESULT_FAILED &&
	               feedback->state != DB_AXIS_ERROR_STOP;
	return result;
}

/* Interval at which a motion is checked, shortest and longest. */
#define CHECK_MIN (5 * DB_NS_PER_MS)
#define CHECK_MAX (50 * DB_NS_PER_MS)

/* A drive that stands elsewhere for this number of cycles, and this time, will not arrive. */
#define PATIENCE_CYCLES 5
#define PATIENCE_MIN (200 * DB_NS_PER_MS)

/* Added to the driver's own patience: a motion that does not show within it does not begin. */
#define REACTION (1 * DB_NS_PER_S)

db_time db_motion_check_interval(const struct db_bus_config *bus)
{
	db_time cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;

	return cycle < CHECK_MIN ? CHECK_MIN : cycle > CHECK_MAX ? CHECK_MAX : cycle;
}

/* --- without an end --------------------------------------------------------------------------- */

/* The values that its stopping distance depends on now. */
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
	struct db_nameplate_copy copy;
	const struct db_nameplate *plate = &copy.plate;

	if (config.deceleration > 0.0 || param < 0)
		return config;
	db_axis_read_nameplate(commander->config.axis, &copy);
	if (db_params_have(plate->valid, (size_t)param))
		config.deceleration = db_value_number(driver->params[param].type,
		                                      plate->values[param]) *
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

struct db_request *db_motion_submit_stop(struct db_commander *commander, enum db_command command,
                                         enum db_stand_cause cause, db_time now)
{
	struct db_request stop = { .command = command, .cause = (uint8_t)cause, .submitted = now };

	return db_flight_submit(commander, &stop);
}

void db_motion_record_stop(struct db_commander *commander, struct db_request *stop,
                           enum db_command command, db_time now)
{
	const struct db_request shown = { .command = command, .cause = stop->cause };

	db_motion_stopped(commander, now);
	db_motion_submitted(commander, NULL, db_request_stop(stop), now);
	/* A repeat of a pending stop already has its history entry. */
	if (stop->noted.entry != 0)
		db_history_repeat(&commander->history, stop->noted.entry);
	else
		db_outcome_record(commander, &shown, DB_RESULT_PENDING, stop);
	commander->newest = stop->ticket;
	db_writers_set_command(&commander->writers, NULL, &shown, DB_RESULT_PENDING, stop->ticket);
}

void db_motion_stopped(struct db_commander *commander, db_time arrived)
{
	if (arrived > commander->stopped)
		commander->stopped = arrived;
}

/* --- beginning and ending --------------------------------------------------------------------- */

/* Another command replaced the motion: mark its result cancelled. */
static void cancel_motion(struct db_commander *commander, db_time now)
{
	db_writers_cancel_motion(&commander->writers);
	/* A motion without an end of its own has done what its command said. */
	if (commander->follow.active && db_motion_of(commander->follow.command) > DB_MOTION_ENDLESS)
		db_outcome_end(commander, commander->follow_noted, DB_RESULT_CANCELLED,
		               now - commander->follow_arrived);
	/* Nothing corrects its result after that. */
	commander->follow.active = commander->follow.late = false;
}

void db_motion_submitted(struct db_commander *commander, struct db_writer *writer,
                         enum db_command command, db_time now)
{
	if (!db_command_ends_motion(command))
		return;
	db_motion_supervise(commander, command, now);
	db_writers_ask_motion(&commander->writers, writer);
	if (!db_command_is_stop(command))
		return;
	cancel_motion(commander, now);
	/* Whichever client sent it: a later motion needs a hold of its own. */
	db_hold_end(&commander->hold);
	for (struct db_request *request = commander->pending; request; request = request->next) {
		if (db_command_replaces_motion(request->command))
			request->overtaken = true;
	}
}

/* The drive has accepted it: its result stays ok, unless the motion ends badly. */
static void begin_motion(struct db_commander *commander, struct db_writer *writer,
                         const struct db_request *request, bool proven, db_time now)
{
	enum db_motion motion = db_motion_of(request->command);

	cancel_motion(commander, now);
	if (!db_command_is_motion(request->command))
		return;
	if (!request->overtaken)
		db_motion_supervise(commander, request->command, now);
	db_writers_begin_motion(&commander->writers, writer, request, motion > DB_MOTION_ENDLESS,
	                        request->overtaken);
	/* A move at speed 0 ends at standstill. */
	if (request->overtaken || motion == DB_MOTION_NONE ||
	    (request->command == DB_CMD_MOVE_VELOCITY &&
	     fpclassify(request->args->target_velocity) == FP_ZERO))
		return;
	db_follow_begin(&commander->follow, request, proven, now);
	commander->follow_noted = request->noted;
	commander->follow_arrived = request->submitted;
	commander->check_at = now + CHECK_MIN;
}

/* A hold ends without a stop when its motion never began, or when the drive has accepted a later
 * motion without a hold. While that is undecided it continues: at worst the holder is then expected
 * to send one beat too many. */
static void note_hold(struct db_commander *commander, const struct db_request *request,
                      enum db_result result)
{
	struct db_hold *hold = &commander->hold;
	/* With such a result the drive may have begun the motion. */
	bool may_have_begun = db_result_is_success(result) || result == DB_RESULT_TIMEOUT ||
	                      result == DB_RESULT_INDETERMINATE || result == DB_RESULT_FAILED;

	if (hold->holder.id == DB_CLIENT_NOBODY)
		return;
	if (request->held && may_have_begun)
		hold->begun = true;
	else if (request->held && !hold->begun &&
	         !db_flight_has(commander, DB_PENDING_HELD_MOTION, request))
		db_hold_end(hold);
	else if (!request->held && db_command_is_motion(request->command) &&
	         db_result_is_success(result) &&
	         commander->submitted - request->number < commander->submitted - hold->number)
		db_hold_end(hold);
}

void db_motion_ended(struct db_commander *commander, const struct db_request *request, db_time now)
{
	struct db_writer *writer = db_writers_find(&commander->writers, db_request_client(request));
	enum db_result result = (enum db_result)request->result;

	/* The drive accepted it, and a stop had been submitted after it. */
	db_outcome_end(commander, request->noted,
	               request->overtaken && db_result_is_success(result) &&
	                               db_command_is_motion(request->command) ?
	                       DB_RESULT_CANCELLED :
	                       result,
	               now - request->submitted);
	note_hold(commander, request, result);
	if (!db_command_replaces_motion(request->command))
		return;
	switch (result) {
	case DB_RESULT_OK:
	case DB_RESULT_UNPROVEN:
		begin_motion(commander, writer, request, result == DB_RESULT_OK, now);
		break;
	/* The current motion of the drive is not known. */
	case DB_RESULT_TIMEOUT:
	case DB_RESULT_INDETERMINATE:
	case DB_RESULT_FAILED:
		cancel_motion(commander, now);
		break;
	/* The command did nothing: the earlier motion continues. */
	default:
		db_writers_refuse_motion(&commander->writers, writer, request->number);
	}
}

/* --- checking --------------------------------------------------------------------------------- */

static void keep_within_limits(struct db_commander *commander, const struct db_feedback *feedback,
                               db_time now)
{
	struct db_supervise_config config;
	struct db_request *stop;
	enum db_limit limit;

	if (!commander->supervise.active || !(feedback->status & DB_STATUS_ONLINE))
		return;
	config = supervise_config(commander, feedback);
	limit = db_supervise_check(&commander->supervise, &config, feedback, now);
	if (limit == DB_LIMIT_NONE)
		return;
	stop = db_motion_submit_stop(commander, DB_CMD_STOP, DB_STAND_LIMIT, now);
	/* Without room for it the next check tries again. */
	commander->supervise.stopped = stop != NULL;
	if (!stop)
		return;
	db_motion_record_stop(commander, stop, DB_CMD_STOP, now);
	db_writers_set_limit(&commander->writers, NULL, limit);
}

/* Within this number of counts of its target a control loop may rest; the motion was not stopped by
 * something. */
#define NEAR_COUNTS 16.0

/* Its in-position window may only be too small. */
static void log_rest(const struct db_commander *commander, const struct db_feedback *feedback)
{
	enum db_command command = commander->follow.command;
	double off = (double)feedback->position - (double)feedback->target;

	if ((command != DB_CMD_MOVE_ABSOLUTE && command != DB_CMD_MOVE_RELATIVE) ||
	    !feedback->has_target || fabs(off) > NEAR_COUNTS ||
	    feedback->state == DB_AXIS_ERROR_STOP)
		return;
	db_outcome_log(commander, NULL,
	               &(struct db_refused_write){
			       .command = command,
			       .off = off,
			       .result = DB_RESULT_FAILED,
		       });
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
		.reaction = patience < REACTION ? REACTION : patience,
	};
	struct db_request *stop = NULL;
	enum db_result result;

	/* A motion was submitted: whether this one reaches its end is open. */
	if (db_flight_has(commander, DB_PENDING_MOTION, NULL))
		return;
	/* A homing stood for longer than homing-pause-ms, was reported as failed, and has continued
	 * since. */
	if (db_follow_is_late(&commander->follow, feedback)) {
		db_outcome_end(commander, commander->follow_noted, DB_RESULT_OK,
		               now - commander->follow_arrived);
		db_writers_end_motion(&commander->writers, commander->follow.ticket, DB_RESULT_OK,
		                      true);
	}
	if (!commander->follow.active)
		return;
	if (db_follow_shows(&commander->follow, feedback))
		db_outcome_end(commander, commander->follow_noted, DB_RESULT_OK,
		               now - commander->follow_arrived);
	result = db_follow_check(&commander->follow, &config, feedback, now);
	if (result == DB_RESULT_PENDING)
		return;
	/* A motion that is reported as failed because it never began must not begin later,
	 * unexpectedly. */
	if (result == DB_RESULT_FAILED && commander->follow.unproven && !commander->follow.moved &&
	    db_motion_of(commander->follow.command) == DB_MOTION_ENDLESS) {
		stop = db_motion_submit_stop(commander, DB_CMD_STOP, DB_STAND_MOTION, now);
		commander->follow.active = stop == NULL;
		if (!stop)
			return;
	}
	db_outcome_end(commander, commander->follow_noted, result, now - commander->follow_arrived);
	db_writers_end_motion(&commander->writers, commander->follow.ticket, result, false);
	if (stop)
		db_motion_record_stop(commander, stop, DB_CMD_STOP, now);
	if (result == DB_RESULT_FAILED)
		log_rest(commander, feedback);
	/* It stands at its end; there is nothing left to hold. */
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
	bool looks = commander->follow.active || commander->follow.late ||
	             commander->supervise.active;

	return looks ? commander->check_at : DB_TIME_NEVER;
}
