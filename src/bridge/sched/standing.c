/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/standing.h"

#include <math.h>
#include <stdlib.h>

/* Fraction of the highest speed: the loss at which a drive counts as slowing down, more than
 * measured speeds fluctuate; and the further loss each time for it to count as still slowing
 * down. */
struct shares {
	float slower;
	float progress;
};

static const struct shares measured = { .slower = 0.05f, .progress = 0.01f };

/* A speed that is computed from two positions is wrong by as much of it as their times are of the
 * time between them, and an adapter alone delivers answers up to 16 ms late. So it is computed over
 * this long, and only the loss of two windows in a row counts: what makes one of them slow makes
 * the next one fast. */
#define WINDOW (STANDING_PATIENCE_COMPUTED / 4)
static const struct shares computed = { .slower = 0.25f, .progress = 0.03f };

/* How long a drive that moved must be seen standing, and how far it may drift meanwhile, in counts:
 * a closed loop dithers, and some drives report no speed while they move. */
#define STILL_TIME (100 * DB_NS_PER_MS)
#define STILL_DRIFT 16

/* How soon a drive is read again after a stop was sent. */
#define LOOK_AFTER (5 * DB_NS_PER_MS)

/* Interval of repeated stops: short at first, because the drive moves; later one that the bus can
 * bear for ever. A sample is awaited first, but not for longer than WITHOUT_LOOK. */
#define PACE_FIRST (20 * DB_NS_PER_MS)
#define FIRST_WHILE (1 * DB_NS_PER_S)
#define PACE (100 * DB_NS_PER_MS)
#define WITHOUT_LOOK (100 * DB_NS_PER_MS)

/* The same in round trips, on a slow line. */
#define FIRST_TRIPS 2
#define PACE_TRIPS 5

/* How soon a refused stop is sent again. */
#define REFUSED_AGAIN (20 * DB_NS_PER_MS)

/* Pause between stops to an offline drive. */
#define BACKOFF_MIN (20 * DB_NS_PER_MS)
#define BACKOFF_MAX (200 * DB_NS_PER_MS)

/* A drive that comes and goes has at least this time to show that it stops, each time that it is
 * online. */
#define PATIENCE_LEFT (100 * DB_NS_PER_MS)

/* A drive that was known to stand is reported as running on, without a sample, only after the
 * patience times this. */
#define UNREAD_PATIENCES 4

/* --- entering and leaving --------------------------------------------------------------------- */

static unsigned bit(unsigned number)
{
	return 1u << number;
}

static const enum db_command strongest_first[] = { DB_CMD_DISABLE, DB_CMD_QUICK_STOP, DB_CMD_STOP };

#define KINDS (sizeof(strongest_first) / sizeof(strongest_first[0]))

/* NONE if there is none. */
static enum db_command strongest(unsigned kinds)
{
	for (size_t i = 0; i < KINDS; i++) {
		if (kinds & bit(strongest_first[i]))
			return strongest_first[i];
	}
	return DB_CMD_NONE;
}

/* Its speed is not known any more. The time from `since` until it is known again does not count; 0:
 * the time from the next stop. */
static void forget_speed(struct standing *standing, db_time since)
{
	standing->speed_known = false;
	standing->unknown_since = since;
}

void standing_enter(struct standing *standing, enum db_command kind, enum db_stand_cause cause,
                    const struct db_feedback *known, db_time now)
{
	float speed = known ? fabsf(known->velocity) : 0.0f;

	if (standing_is_free(standing))
		*standing = (struct standing){ .since = now };
	standing->kinds |= bit(kind);
	standing->cause = cause;
	standing->causes |= bit(cause);
	/* This stop or a stronger one was sent and is unanswered: however often it is requested
	 * again, it is sent at its interval, or repeated requests would keep the bus from all
	 * others. */
	if (!standing->gives_way && !standing->obeys && standing->sent_at != 0 &&
	    standing->losses > 0 && strongest(standing->kinds) == standing->kind &&
	    !(kind == DB_CMD_DISABLE && standing->confirmed))
		return;
	/* A stronger stop has its own time to take effect. */
	if (strongest(standing->kinds) != standing->kind) {
		standing->kind = strongest(standing->kinds);
		standing->overdue = false;
		standing->progress = 0;
	}
	standing->refused = 0;
	standing->sent_at = 0;
	standing->interrupted = false;
	standing->send_at = now;
	standing->losses = 0;
	standing->backoff = BACKOFF_MIN;
	standing->gives_way = standing->obeys = standing->slows = standing->read_since =
		standing->acknowledged = false;
	standing->confirmed &= kind != DB_CMD_DISABLE;
	standing->may_move |= !known || (known->status & DB_STATUS_MOVING) || speed > 0.0f;
	/* Earlier speeds do not count: a motion in between may just have begun. */
	standing->speed = (struct standing_speed){ .top = speed, .least = speed };
	standing->window.since = 0;
	/* A disable may be given again and again while the drive runs on, and is no reason to wait
	 * longer. */
	if (kind != DB_CMD_DISABLE)
		forget_speed(standing, standing->progress > 0 ? standing->progress : 0);
	standing->still_since = 0;
	standing->read_at = DB_TIME_NEVER;
}

void standing_owe(struct standing *standing, enum db_command kind)
{
	if (kind == DB_CMD_DISABLE)
		return;
	standing->wide |= bit(kind);
	standing->owed |= bit(kind);
}

/* Closes the record: the drive is free. */
static void leave(struct standing *standing)
{
	*standing = (struct standing){ .kind = DB_CMD_NONE };
}

void standing_withdraw(struct standing *standing, enum db_stand_cause cause)
{
	standing->causes &= ~bit(cause);
	if (standing->causes == 0)
		leave(standing);
}

/* --- sending ---------------------------------------------------------------------------------- */

db_time standing_send_at(const struct standing *standing)
{
	bool obeyed = (standing->obeys || standing->slows) &&
	              (standing->kind != DB_CMD_DISABLE || standing->confirmed);

	if (standing_is_free(standing) || standing->gives_way)
		return DB_TIME_NEVER;
	/* Where a stop is not acknowledged, the slow-down may be that of an older motion. */
	if (obeyed)
		return standing->acknowledged || standing_is_seen_still(standing) ?
		               DB_TIME_NEVER :
		               standing->sent_at + PACE;
	/* Repeating the stop must not take the time in which its effect could be read. */
	return standing->read_since || standing->sent_at == 0 ||
	                       standing->send_at > standing->read_by ?
	               standing->send_at :
	               standing->read_by;
}

enum db_command standing_next(const struct standing *standing)
{
	enum db_command next = strongest(standing->kinds & ~standing->refused);
	enum db_command owed = strongest(standing->owed & ~standing->refused);

	if (standing->kind == DB_CMD_DISABLE && owed != DB_CMD_NONE &&
	    (standing->confirmed || !standing->wide_was_last))
		return owed;
	return next == DB_CMD_NONE ? standing->kind : next;
}

void standing_stop_sent(struct standing *standing, bool trusted, db_time round_trip, db_time now)
{
	bool first = now - standing->since < FIRST_WHILE;
	db_time pace = first ? PACE_FIRST : PACE;
	db_time share = round_trip * (first ? FIRST_TRIPS : PACE_TRIPS);

	standing->count++;
	/* A disable whose first frame alone was sent blind has not had its turn. */
	if (trusted || standing_next(standing) != DB_CMD_DISABLE)
		standing->wide_was_last = standing->wide & bit(standing_next(standing));
	standing->sent_at = now;
	standing->read_since = !trusted;
	standing->read_by = now + WITHOUT_LOOK;
	if (standing->progress == 0)
		standing->progress = now;
	if (standing->unknown_since == 0)
		standing->unknown_since = now;
	if (trusted)
		standing->send_at = now + (pace > share ? pace : share);
}

void standing_stop_answered(struct standing *standing, enum db_command command, bool taken,
                            bool acknowledged, db_time now)
{
	/* An older stop was answered: this shows nothing about the cause that joined after it. */
	if (standing_is_free(standing) || standing->sent_at == 0)
		return;
	standing->losses = 0;
	standing->acknowledged = taken && acknowledged;
	standing->backoff = BACKOFF_MIN;
	standing->read_at = now + LOOK_AFTER;
	standing->read_by = now + WITHOUT_LOOK;
	standing->confirmed |= command == DB_CMD_DISABLE;
	/* An answer to one serves for all that are owed; a refusal is of that one only. */
	if (command != DB_CMD_DISABLE)
		standing->owed = taken ? 0 : standing->owed & ~bit(command);
	if (taken) {
		standing->refused = 0;
		/* The other one of the two is due at once. */
		if (standing->wide != 0 &&
		    (standing->owed != 0 ||
		     (standing->kind == DB_CMD_DISABLE && !standing->confirmed))) {
			standing->send_at = now;
			standing->read_since = true;
		}
		return;
	}
	standing->refused |= bit(command);
	if ((standing->kinds & ~standing->refused) == 0)
		standing->refused = 0;
	standing->send_at = now + REFUSED_AGAIN;
	/* A refused stop has no effect to wait for. */
	standing->read_since = true;
}

bool standing_stop_lost(struct standing *standing, bool online, unsigned retries, db_time cost,
                        db_time now)
{
	db_time share = cost * (STANDING_LOSSES_SHARE - 1);

	standing->losses++;
	standing->read_since = true;
	standing->send_at = now;
	/* A drive known to be silent is not hurried: each attempt costs the whole time-out. */
	if (online && standing->losses <= retries)
		return false;
	if (!online) {
		share = share > standing->backoff ? share : standing->backoff;
		standing->backoff = standing->backoff < BACKOFF_MAX / 2 ? 2 * standing->backoff :
		                                                          BACKOFF_MAX;
	}
	standing->send_at = now + share;
	return true;
}

void standing_resume(struct standing *standing, db_time now)
{
	if (standing_is_free(standing))
		return;
	/* Negative: this much of its patience was used up before it went offline. */
	standing->progress = standing->progress < 0 ? now + standing->progress : 0;
	standing->sent_at = 0;
	standing->interrupted = false;
	standing->send_at = now;
	standing->read_at = DB_TIME_NEVER;
	standing->losses = 0;
	standing->backoff = BACKOFF_MIN;
	standing->gives_way = standing->obeys = standing->slows = standing->read_since =
		standing->confirmed = false;
	/* A controller that answers everything but stops comes back again and again: whose turn it
	 * is stays, or the disable would never have one. */
	if (standing->owed == 0)
		standing->wide_was_last = false;
	standing->owed = standing->wide;
	standing->may_move = true;
	standing->speed = (struct standing_speed){ .top = 0.0f };
	standing->window.since = 0;
	forget_speed(standing, 0);
	standing->still_since = 0;
}

/* Where a speed is computed, the time until it is known is not the drive's. */
static db_time patience_with(const struct standing *standing, const struct standing_rules *rules)
{
	return rules->computed && !standing->speed_known ? rules->patience + 2 * WINDOW :
	                                                   rules->patience;
}

void standing_suspend(struct standing *standing, const struct standing_rules *rules, db_time now)
{
	db_time used = standing->progress > 0 ? now - standing->progress : 0;
	db_time most;

	forget_speed(standing, 0);
	most = patience_with(standing, rules);
	most = most > PATIENCE_LEFT ? most - PATIENCE_LEFT : 0;
	standing->obeys = false;
	standing->progress = -(used < most ? used : most);
}

bool standing_gives_way_to(const struct standing *standing, enum db_command command)
{
	return !standing_is_free(standing) &&
	       (db_command_replaces_motion(command) ||
	        (command == DB_CMD_ENABLE && standing_is_seen_still(standing)));
}

void standing_drive_enabled(struct standing *standing)
{
	/* A disable that joined after it was not sent yet. */
	if (standing->kind != DB_CMD_DISABLE || standing->sent_at == 0)
		return;
	standing->kinds = (standing->kinds & ~bit(DB_CMD_DISABLE)) | bit(DB_CMD_STOP);
	standing->kind = strongest(standing->kinds);
}

void standing_motion_ended(struct standing *standing, bool may_go_on, db_time now)
{
	if (!standing->gives_way)
		return;
	if (may_go_on) {
		leave(standing);
		return;
	}
	standing->gives_way = false;
	standing->send_at = now;
	standing->read_since = true;
}

/* --- judging ---------------------------------------------------------------------------------- */

static bool is_expired(const struct standing *standing, const struct standing_rules *rules,
                       db_time now)
{
	return standing->progress > 0 && now - standing->progress >= patience_with(standing, rules);
}

static enum standing_verdict judge_standing(struct standing *standing,
                                            const struct standing_rules *rules,
                                            const struct db_feedback *feedback, db_time now)
{
	/* A position that keeps changing is motion, whatever else the drive reports. */
	bool drifting = standing->still_since != 0 &&
	                llabs((int64_t)feedback->position - standing->still_position) > STILL_DRIFT;
	db_time still;

	if (standing->still_since == 0 || drifting) {
		standing->still_since = now;
		standing->still_position = feedback->position;
	}
	if (drifting) {
		standing->may_move = true;
		standing->obeys = false;
		return is_expired(standing, rules, now) ? STANDING_RUNS_ON : STANDING_UNSEEN;
	}
	still = now - standing->still_since;
	/* Time counts on while a stop is owed, though this axis stands. */
	if (standing->owed == 0)
		standing->progress = now;
	if (still < rules->doubt)
		return STANDING_UNSEEN;
	/* A drive that moved may have been seen at the turning point of a reversal. */
	if ((standing->may_move && still < STILL_TIME) || standing->owed != 0 ||
	    (standing->kind == DB_CMD_DISABLE && !standing->confirmed)) {
		standing->speed.least = 0.0f;
		standing->obeys = true;
		return STANDING_OBEYS;
	}
	leave(standing);
	return STANDING_DONE;
}

/* Follows the speed, which is between `low` and `high`. *slower: it has lost its share of the
 * highest, and has not become faster again. True if the drive is still slowing down, or has begun
 * anew. */
static bool follow_speed(struct standing_speed *seen, float low, float high,
                         const struct shares *shares, bool *slower)
{
	float speed = 0.5f * low + 0.5f * high;
	bool progress = false;
	float margin;

	if (low > seen->top) {
		seen->top = low;
		if (low - seen->least > shares->slower * low)
			seen->least = speed;
	}
	margin = shares->slower * seen->top;
	if (speed < seen->least && speed <= seen->least - shares->progress * seen->top) {
		seen->least = speed;
		progress = true;
	}
	if (low > seen->least + margin) {
		/* Slower and then faster again was a reversal that continued, not a stop. */
		*slower = false;
		seen->top = low;
		seen->least = speed;
		return true;
	}
	if (high < seen->top - margin)
		*slower = true;
	return progress;
}

static void judge_window(struct standing *standing, const struct db_feedback *feedback, db_time now)
{
	struct standing_window *window = &standing->window;
	db_time took = feedback->taken - window->since;
	float way = (float)fabs((double)feedback->position - (double)window->position);
	float speed;

	if (window->since == 0) {
		*window = (struct standing_window){ .before = -1.0f };
	} else if (took < WINDOW) {
		return;
	} else {
		speed = way * (float)DB_NS_PER_S / (float)took;
		if (window->before >= 0.0f &&
		    follow_speed(&window->speed, fminf(speed, window->before),
		                 fmaxf(speed, window->before), &computed, &standing->obeys))
			standing->progress = now;
		/* Its speed is known from the second window on. The time before that does not
		 * count. */
		if (window->before >= 0.0f && !standing->speed_known) {
			standing->speed_known = true;
			standing->progress += now - standing->unknown_since;
			if (standing->progress > now)
				standing->progress = now;
		}
		window->before = speed;
	}
	window->since = feedback->taken;
	window->position = feedback->position;
	/* On a long cycle two windows would take longer than the patience. */
	if (window->since + WINDOW < standing->read_at)
		standing->read_at = window->since + WINDOW;
}

static enum standing_verdict judge_moving(struct standing *standing,
                                          const struct standing_rules *rules,
                                          const struct db_feedback *feedback, db_time now)
{
	float speed = fabsf(feedback->velocity);
	bool progress = follow_speed(&standing->speed, speed, speed, &measured,
	                             rules->computed ? &standing->slows : &standing->obeys);

	if (rules->computed && standing->still_since != 0) {
		standing->obeys = false;
		standing->window.since = 0;
	}
	standing->still_since = 0;
	standing->may_move = true;
	if (rules->computed)
		judge_window(standing, feedback, now);
	else if (progress)
		standing->progress = now;
	if (is_expired(standing, rules, now)) {
		standing->obeys = standing->slows = false;
		return STANDING_RUNS_ON;
	}
	return standing->obeys ? STANDING_OBEYS : STANDING_UNSEEN;
}

enum standing_verdict standing_judge(struct standing *standing, const struct standing_rules *rules,
                                     const struct db_feedback *feedback, db_time asked, db_time now)
{
	enum standing_verdict verdict;

	if (standing_is_free(standing) || standing->gives_way || standing->sent_at == 0 ||
	    asked <= standing->sent_at || !(feedback->status & DB_STATUS_ONLINE))
		return STANDING_UNSEEN;
	standing->read_since = true;
	verdict = feedback->status & DB_STATUS_MOVING ?
	                  judge_moving(standing, rules, feedback, now) :
	                  judge_standing(standing, rules, feedback, now);
	if (standing->owed == 0)
		return verdict;
	standing->slows = false;
	if (verdict != STANDING_OBEYS)
		return verdict;
	standing->obeys = false;
	return is_expired(standing, rules, now) ? STANDING_RUNS_ON : STANDING_UNSEEN;
}

db_time standing_deadline(const struct standing *standing, const struct standing_rules *rules)
{
	/* A drive that stood before the stop is not moving because a line with many drives has had
	 * no time to read it yet. */
	db_time patience = standing->may_move ? patience_with(standing, rules) :
	                                        UNREAD_PATIENCES * rules->patience;

	return standing_is_free(standing) || standing->gives_way || standing->overdue ||
	                       standing->progress <= 0 || standing->sent_at == 0 ?
	               DB_TIME_NEVER :
	               standing->progress + patience;
}

void standing_run_on(struct standing *standing, bool last_resort, db_time now)
{
	if (last_resort && standing->kind != DB_CMD_DISABLE)
		standing_enter(standing, DB_CMD_DISABLE, standing->cause, NULL, now);
	standing->obeys = standing->slows = false;
	standing->overdue = true;
}
