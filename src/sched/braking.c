/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/braking.h"

#include <math.h>

/* Of the highest speed: what a drive must have lost to be seen to slow down, more than measured speeds
 * waver; and what it must lose more and more of to be seen to go on with it. */
#define SLOWER_SHARE 0.05f
#define PROGRESS_SHARE 0.01f

/* How long a drive that moved must be seen to stand. */
#define STILL_TIME (100 * DB_NS_PER_MS)

/* How soon a drive is read again that was told to stop. */
#define LOOK_AFTER (5 * DB_NS_PER_MS)

/* How soon it is told again: often at first, because it moves; then as the bus can bear for ever. */
#define SAY_AFTER_FIRST (20 * DB_NS_PER_MS)
#define FIRST_WHILE (200 * DB_NS_PER_MS)
#define SAY_AFTER (100 * DB_NS_PER_MS)
#define SAY_AFTER_OVERDUE (500 * DB_NS_PER_MS)

void braking_begin(struct braking *braking, const struct db_feedback *before, db_time now)
{
	float speed = fabsf(before->velocity);

	*braking = (struct braking){
		.active = true,
		.begun = now,
		.progress = now,
		.top_speed = speed,
		.least_speed = speed,
	};
}

void braking_resume(struct braking *braking, db_time now)
{
	braking->slows = false;
	braking->begun = braking->progress = now;
	braking->look_at = braking->again_at = now;
	braking->looked = true;
	braking->top_speed = braking->least_speed = 0.0f;
	braking->still_from = 0;
}

void braking_said(struct braking *braking, db_time now)
{
	db_time again = braking->overdue                   ? SAY_AFTER_OVERDUE :
	                now - braking->begun < FIRST_WHILE ? SAY_AFTER_FIRST :
	                                                     SAY_AFTER;

	/* Saying it again must not take the time in which its effect could be read. */
	braking->looked = false;
	braking->look_at = now + LOOK_AFTER;
	braking->again_at = now + again;
}

static enum braking_verdict judge_standing(struct braking *braking, db_time doubt, db_time now)
{
	db_time still;

	if (braking->still_from == 0)
		braking->still_from = now;
	still = now - braking->still_from;
	if (still < doubt)
		return BRAKING_UNSEEN;
	/* One that moved may have been seen at the turning point of a reversal. */
	if (braking->top_speed > 0.0f && still < STILL_TIME) {
		braking->least_speed = 0.0f;
		braking->slows = true;
		return BRAKING_SLOWS;
	}
	return BRAKING_STANDS;
}

static void follow_speed(struct braking *braking, float speed, db_time now)
{
	if (speed > braking->top_speed) {
		braking->top_speed = speed;
		braking->least_speed = speed;
	}
	if (speed <= braking->least_speed - PROGRESS_SHARE * braking->top_speed) {
		braking->least_speed = speed;
		braking->progress = now;
	}
}

enum braking_verdict braking_judge(struct braking *braking, const struct db_feedback *feedback,
                                   db_time patience, db_time doubt, db_time now)
{
	float speed = fabsf(feedback->velocity);
	float margin;

	if (!(feedback->status & DB_STATUS_MOVING))
		return judge_standing(braking, doubt, now);
	braking->still_from = 0;
	follow_speed(braking, speed, now);
	margin = SLOWER_SHARE * braking->top_speed;
	if (speed > braking->least_speed + margin) {
		/* Slower and then faster again was a reversal that went on, not a stop. */
		braking->slows = false;
		braking->top_speed = braking->least_speed = speed;
		braking->progress = now;
	} else if (braking->least_speed < braking->top_speed - margin) {
		braking->slows = true;
	}
	if (now - braking->progress >= patience)
		return BRAKING_FAILS;
	return braking->slows ? BRAKING_SLOWS : BRAKING_UNSEEN;
}
