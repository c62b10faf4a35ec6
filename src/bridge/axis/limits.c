/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include <math.h>

static const char *const names[DB_LIMIT_COUNT] = {
	[DB_LIMIT_NONE] = "none",
	[DB_LIMIT_MIN_POSITION] = "min_position",
	[DB_LIMIT_MAX_POSITION] = "max_position",
	[DB_LIMIT_MAX_VELOCITY] = "max_velocity",
	[DB_LIMIT_MAX_ACCELERATION] = "max_acceleration",
};

const char *db_limit_name(uint16_t limit)
{
	return limit < DB_LIMIT_COUNT ? names[limit] : "unknown";
}

/* Limits that are not set are NAN, and no comparison with that is true. */

static double to_units(const struct db_drive_config *drive, double counts,
                       const struct db_limit_facts *facts)
{
	return counts / (facts->counts > 0.0 ? facts->counts : drive->counts_per_unit);
}

static enum db_limit check_position(const struct db_drive_config *drive, double counts,
                                    const struct db_limit_facts *facts)
{
	double units = to_units(drive, counts, facts);

	if (facts->scale_open && !isnan(drive->min_position))
		return DB_LIMIT_MIN_POSITION;
	if (facts->scale_open && !isnan(drive->max_position))
		return DB_LIMIT_MAX_POSITION;
	if (units < drive->min_position)
		return DB_LIMIT_MIN_POSITION;
	return units > drive->max_position ? DB_LIMIT_MAX_POSITION : DB_LIMIT_NONE;
}

static enum db_limit check_velocity(const struct db_drive_config *drive, double velocity,
                                    const struct db_limit_facts *facts)
{
	double counts = facts->velocity_counts > 0.0 ? velocity * facts->velocity_counts : velocity;

	if (facts->scale_open && !isnan(drive->max_velocity))
		return DB_LIMIT_MAX_VELOCITY;
	return fabs(to_units(drive, counts, facts)) > drive->max_velocity ? DB_LIMIT_MAX_VELOCITY :
	                                                                    DB_LIMIT_NONE;
}

static enum db_limit check_preset(const struct db_drive_config *drive,
                                  const struct db_limit_facts *facts)
{
	if (isnan(drive->max_velocity))
		return DB_LIMIT_NONE;
	return facts->has_preset ? check_velocity(drive, (double)facts->preset_velocity, facts) :
	                           DB_LIMIT_MAX_VELOCITY;
}

/* The limit that the drive is beyond already while the motion leads further out. */
static enum db_limit check_direction(const struct db_drive_config *drive, double velocity,
                                     const struct db_limit_facts *facts)
{
	enum db_limit broken = check_position(drive, (double)facts->position, facts);

	/* The position is not known, so no direction is safe. */
	if (facts->scale_open)
		return broken;
	if ((broken == DB_LIMIT_MIN_POSITION && velocity < 0.0) ||
	    (broken == DB_LIMIT_MAX_POSITION && velocity > 0.0))
		return broken;
	return DB_LIMIT_NONE;
}

enum db_limit db_limits_command(const struct db_drive_config *drive, enum db_command command,
                                const struct db_args *args, const struct db_limit_facts *facts)
{
	double velocity = (double)args->target_velocity;
	double target = (double)args->target_position;
	enum db_limit speed = velocity > 0.0 || velocity < 0.0 ?
	                              check_velocity(drive, velocity, facts) :
	                              check_preset(drive, facts);
	enum db_limit first = DB_LIMIT_NONE; /* what is shown if both limits are broken */
	enum db_limit second = DB_LIMIT_NONE;

	switch (command) {
	case DB_CMD_MOVE_ABSOLUTE:
		first = check_position(drive, target, facts);
		second = speed;
		break;
	case DB_CMD_MOVE_RELATIVE:
		first = check_position(drive, (double)facts->position + target, facts);
		second = speed;
		break;
	case DB_CMD_MOVE_VELOCITY:
		first = check_velocity(drive, velocity, facts);
		second = check_direction(drive, velocity, facts);
		break;
	case DB_CMD_MOVE_PRESET:
		first = check_preset(drive, facts);
		second = check_direction(drive, (double)facts->preset_velocity, facts);
		break;
	case DB_CMD_JOG_POSITIVE:
		first = check_preset(drive, facts);
		second = check_direction(drive, 1.0, facts);
		break;
	case DB_CMD_JOG_NEGATIVE:
		first = check_preset(drive, facts);
		second = check_direction(drive, -1.0, facts);
		break;
	case DB_CMD_MOVE_CURRENT:
		first = check_direction(drive, (double)args->target_current, facts);
		break;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		first = check_position(drive, (double)args->shake_start_position, facts);
		second = check_position(drive, (double)args->shake_end_position, facts);
		break;
	default:
		break;
	}
	return first != DB_LIMIT_NONE ? first : second;
}

enum db_limit db_limits_acceleration(const struct db_drive_config *drive, double acceleration,
                                     const struct db_limit_facts *facts)
{
	if (facts->scale_open && !isnan(drive->max_acceleration))
		return DB_LIMIT_MAX_ACCELERATION;
	return fabs(to_units(drive, acceleration, facts)) > drive->max_acceleration ?
	               DB_LIMIT_MAX_ACCELERATION :
	               DB_LIMIT_NONE;
}

struct db_allowed db_limits_allowed(const struct db_drive_config *drive,
                                    const struct db_limit_facts *facts)
{
	double counts = facts->counts > 0.0 ? facts->counts : drive->counts_per_unit;

	if (facts->scale_open)
		counts = (double)NAN;
	return (struct db_allowed){
		.min_position = drive->min_position * counts,
		.max_position = drive->max_position * counts,
		.max_velocity = drive->max_velocity * counts /
		                (facts->velocity_counts > 0.0 ? facts->velocity_counts : 1.0),
	};
}

/* A motion that stands for this time is no longer watched. */
#define IDLE_TIME (1 * DB_NS_PER_S)

bool db_supervise_applies(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_PRESET:
	case DB_CMD_MOVE_CURRENT:
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
		return true;
	default:
		return false;
	}
}

void db_supervise_begin(struct db_supervise *supervise, db_time now)
{
	supervise->active = true;
	supervise->stopped = supervise->measuring = false;
	supervise->begun = supervise->since = now;
}

static double to_seconds(db_time span)
{
	return (double)span / (double)DB_NS_PER_S;
}

void db_supervise_stop(struct db_supervise *supervise, const struct db_supervise_config *config,
                       const struct db_feedback *feedback, db_time now)
{
	double velocity = (double)feedback->velocity * config->velocity_counts;

	if (!supervise->active || supervise->measuring || !(fabs(velocity) > 0.0))
		return;
	supervise->measuring = true;
	/* Its present position if it continued at its speed. */
	supervise->from = (double)feedback->position + velocity * to_seconds(now - feedback->taken);
	supervise->from_speed = fabs(velocity);
}

/* The limit that it would pass if it were stopped one check later. */
static enum db_limit find_limit_ahead(struct db_supervise *supervise,
                                      const struct db_supervise_config *config,
                                      const struct db_feedback *feedback, db_time now)
{
	double computed = config->deceleration > 0.0 ? 0.5 / config->deceleration : 0.0;
	double velocity = (double)feedback->velocity * config->velocity_counts;
	double speed = fabs(velocity);
	double growth = 0.0;
	double ahead;

	/* From one check to the next; positive: it gets faster. */
	if (feedback->taken > supervise->last_taken)
		growth = fmax(0.0, speed - supervise->last_speed);
	supervise->last_speed = speed;
	supervise->last_taken = feedback->taken;
	speed += growth;
	ahead = speed * (to_seconds(now - feedback->taken) + to_seconds(config->delay)) +
	        speed * speed * fmax(computed, supervise->measured);
	/* Comparisons with a limit that is not set are never true. */
	if (velocity > 0.0 && (double)feedback->position + ahead >= config->max)
		return DB_LIMIT_MAX_POSITION;
	if (velocity < 0.0 && (double)feedback->position - ahead <= config->min)
		return DB_LIMIT_MIN_POSITION;
	return DB_LIMIT_NONE;
}

enum db_limit db_supervise_check(struct db_supervise *supervise,
                                 const struct db_supervise_config *config,
                                 const struct db_feedback *feedback, db_time now)
{
	double speed = supervise->from_speed;
	enum db_limit limit;

	if (!supervise->active || feedback->taken <= supervise->begun)
		return DB_LIMIT_NONE;
	if (!(feedback->status & DB_STATUS_MOVING)) {
		if (supervise->measuring && feedback->taken > supervise->since) {
			/* It stands after a stop: the way is measured. That of the fastest stop
			 * counts: in slow ones most of the way passes until the drive receives the
			 * stop. */
			supervise->measuring = false;
			if (speed >= supervise->measured_speed) {
				supervise->measured = fabs((double)feedback->position -
				                           supervise->from) /
				                      (speed * speed);
				supervise->measured_speed = speed;
			}
		}
		supervise->stopped = false;
		supervise->active = now - supervise->since < IDLE_TIME;
		return DB_LIMIT_NONE;
	}
	supervise->since = now;
	limit = find_limit_ahead(supervise, config, feedback, now);
	if (limit == DB_LIMIT_NONE || supervise->stopped)
		return DB_LIMIT_NONE;
	supervise->stopped = true;
	return limit;
}
