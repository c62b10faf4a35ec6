/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/supervise.h"

#include <math.h>

/* What stands for so long is watched no more. */
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

static double velocity_of(const struct db_supervise_config *config,
                          const struct db_feedback *feedback)
{
	return (double)feedback->velocity * config->velocity_counts;
}

void db_supervise_stop(struct db_supervise *supervise, const struct db_supervise_config *config,
                       const struct db_feedback *feedback, db_time now)
{
	double velocity = velocity_of(config, feedback);

	if (!supervise->active || supervise->measuring || !(fabs(velocity) > 0.0))
		return;
	supervise->measuring = true;
	/* Where it is by now, if it went on as it did. */
	supervise->from = (double)feedback->position + velocity * to_seconds(now - feedback->taken);
	supervise->from_speed = fabs(velocity);
}

/* It stands after a stop. The fastest counts: in slow ones what passes until the drive hears is
 * most of the way. */
static void measure_braking(struct db_supervise *supervise, const struct db_feedback *feedback)
{
	double speed = supervise->from_speed;
	double measured = fabs((double)feedback->position - supervise->from) / (speed * speed);

	supervise->measuring = false;
	if (speed < supervise->measured_speed)
		return;
	supervise->measured = measured;
	supervise->measured_speed = speed;
}

/* The limit that it would pass if it were told to stop one look later. */
static enum db_limit find_limit_ahead(struct db_supervise *supervise,
                                      const struct db_supervise_config *config,
                                      const struct db_feedback *feedback, db_time now)
{
	double computed = config->deceleration > 0.0 ? 0.5 / config->deceleration : 0.0;
	double velocity = velocity_of(config, feedback);
	double speed = fabs(velocity);
	double growth = 0.0;
	double ahead;

	/* From one look to the next; positive: it gets faster. */
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
	enum db_limit limit;

	if (!supervise->active || feedback->taken <= supervise->begun)
		return DB_LIMIT_NONE;
	if (!(feedback->status & DB_STATUS_MOVING)) {
		if (supervise->measuring && feedback->taken > supervise->since)
			measure_braking(supervise, feedback);
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
