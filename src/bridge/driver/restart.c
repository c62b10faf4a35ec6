/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/restart.h"

#include <math.h>

/* A closed loop trembles by some counts: only a longer way is a motion. */
#define POSITION_NOISE 16.0
/* A drive whose counter has just restarted is this near to 0, in counts. */
#define NEAR_ZERO 2.0
/* The effect of a command shows within this time. */
#define EFFECT_TIME (2 * DB_NS_PER_S)
/* Axes of one controller are read one after the other. */
#define TOGETHER (2 * DB_NS_PER_S)

static double distance(int32_t a, int32_t b)
{
	return fabs((double)a - (double)b);
}

static void see_restart(struct restart *restart)
{
	restart->restarts++;
	restart->origin_lost = true;
	restart->doubt = DB_DOUBT_NONE;
}

static void begin_doubt(struct restart *restart, int32_t from, db_time now)
{
	restart->doubts++;
	restart->doubted = now;
	restart->doubted_from = from;
	restart->doubt = DB_DOUBT_SIGN;
}

static enum restart_verdict judge(struct restart *restart, const struct restart_sample *sample,
                                  db_time now)
{
	/* A drive that moved may have arrived there. */
	bool jumped = restart->stood && sample->stands &&
	              distance(sample->position, 0) <= NEAR_ZERO &&
	              distance(restart->position, sample->position) > POSITION_NOISE;
	bool power = restart->power_went != 0 && now - restart->power_went <= TOGETHER;

	/* The position and the power are not read at the same moment. */
	if (!jumped)
		return power && restart_confirm(restart, now) ? RESTART_SEEN : RESTART_NONE;
	if (power || restart->away) {
		see_restart(restart);
		return RESTART_SEEN;
	}
	begin_doubt(restart, restart->position, now);
	return RESTART_DOUBT;
}

enum restart_verdict restart_judge(struct restart *restart, const struct restart_sample *sample,
                                   db_time now)
{
	bool judged = restart->known && !sample->busy && now >= restart->judged_from;
	enum restart_verdict verdict;

	if (sample->power_went)
		restart->power_went = now;
	verdict = judged ? judge(restart, sample, now) : RESTART_NONE;
	/* The drive is where it was, and not where counters begin: it has kept counting. */
	if (restart->doubt != DB_DOUBT_NONE && verdict == RESTART_NONE &&
	    distance(restart->doubted_from, sample->position) <= POSITION_NOISE &&
	    distance(sample->position, 0) > POSITION_NOISE)
		restart->doubt = DB_DOUBT_NONE;
	restart->known = true;
	restart->away = false;
	restart->stood = sample->stands;
	restart->position = sample->position;
	return verdict;
}

bool restart_confirm(struct restart *restart, db_time now)
{
	if (restart->doubt == DB_DOUBT_NONE || now - restart->doubted > TOGETHER)
		return false;
	see_restart(restart);
	return true;
}

void restart_note_command(struct restart *restart, enum db_command command, db_time now)
{
	if (db_command_is_motion(command) || command == DB_CMD_SET_POSITION)
		restart->judged_from = now + EFFECT_TIME;
}

void restart_note_jump(struct restart *restart, int32_t from, db_time now)
{
	if (now >= restart->judged_from)
		begin_doubt(restart, from, now);
}

void restart_note_placed(struct restart *restart, int32_t position)
{
	restart->position = position;
	restart->judged_from = 0; /* the effect was seen */
	restart->origin_lost = false;
	(void)restart_settle(restart);
}

bool restart_settle(struct restart *restart)
{
	bool doubtful = restart->doubt != DB_DOUBT_NONE;

	restart->doubt = DB_DOUBT_NONE;
	return doubtful;
}

void restart_note_away(struct restart *restart)
{
	restart->away = restart->known;
}

void restart_show(const struct restart *restart, struct db_feedback *feedback)
{
	feedback->restarts = restart->restarts;
	feedback->doubts = restart->doubts;
	feedback->doubt = (uint8_t)restart->doubt;
	if (restart->origin_lost)
		feedback->status |= DB_STATUS_ORIGIN_LOST;
}
