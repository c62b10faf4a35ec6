/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/visit.h"

#include <stdio.h>
#include <string.h>

/* Number of questions to a silent address, and to one from which something was received: drives
 * that share an address do not always send at the same time. */
#define ASKED_SILENT 2
#define ASKED_IF_RECEIVED 5
#define ASKED_IDENTITY 3
/* When a drive is set up, fewer questions are enough: it was looked for before. */
#define ASKED_SET_UP 3

/* Damage that occurs once is the line's, and one answer too many is a late one. */
#define OFTEN 2

/* Number of questions whether it stands, until one is answered. */
#define ASKED_STANDING 3

void visit_begin(struct visit *visit, const struct db_driver *driver, unsigned speed,
                 unsigned address, enum db_inquiry_kind set_up, unsigned value)
{
	*visit = (struct visit){
		.find = { .speed = speed, .address = address },
		.set_up = set_up,
		.value = value,
		.axes = driver->axes > 0 ? driver->axes : 1,
		.end = DB_SCAN_RUNS,
	};
}

static bool is_heard(const struct visit *visit)
{
	return visit->find.answered + visit->find.garbled > 0;
}

static unsigned asked_at_most(const struct visit *visit)
{
	if (!is_heard(visit))
		return ASKED_SILENT;
	return visit->set_up == DB_INQUIRY_THERE ? ASKED_IF_RECEIVED : ASKED_SET_UP;
}

static enum db_scan_verdict judge(const struct db_scan_find *find)
{
	if (find->other[0] || find->doubled >= OFTEN ||
	    (find->answered > 0 && find->garbled + find->doubled >= OFTEN))
		return DB_SCAN_TWO;
	return find->answered > 0 ? DB_SCAN_ONE : DB_SCAN_GARBLED;
}

bool visit_next(const struct visit *visit, struct db_inquiry *inquiry)
{
	*inquiry = (struct db_inquiry){ .address = visit->find.address };
	if (visit->end != DB_SCAN_RUNS)
		return false;
	if (visit->asked < asked_at_most(visit)) {
		inquiry->kind = DB_INQUIRY_THERE;
		inquiry->value = visit->unanswered;
		return true;
	}
	if (visit->find.answered == 0)
		return false;
	if (visit->set_up == DB_INQUIRY_THERE) {
		inquiry->kind = DB_INQUIRY_IDENTITY;
		inquiry->value = visit->unidentified;
		return visit->identities < ASKED_IDENTITY;
	}
	if (visit->standings < visit->axes) {
		inquiry->kind = DB_INQUIRY_STANDING;
		inquiry->value = visit->standings;
		return true;
	}
	/* Sent once: its outcome ends the visit. */
	inquiry->kind = visit->set_up;
	inquiry->value = visit->value;
	return true;
}

/* A question whether a drive is there. */
static void add_presence(struct visit *visit, const struct visit_outcome *outcome)
{
	struct db_scan_find *find = &visit->find;
	uint32_t time_us = outcome->time_us;

	find->asked++;
	find->answered += outcome->answered;
	find->doubled += outcome->doubled;
	find->garbled += outcome->garbled;
	if (!outcome->answered)
		return;
	visit->time_sum_us += time_us;
	if (find->time_min_us == 0 || time_us < find->time_min_us)
		find->time_min_us = time_us;
	if (time_us > find->time_max_us)
		find->time_max_us = time_us;
	find->time_mean_us = (uint32_t)(visit->time_sum_us / find->answered);
}

static void add_standing(struct visit *visit, const struct visit_outcome *outcome)
{
	if (outcome && !outcome->answered && ++visit->standing_tries < ASKED_STANDING)
		return;
	visit->standings++;
	visit->standing_tries = 0;
	/* An axis that a controller does not have is refused. */
	if (outcome && outcome->said.refused && visit->standings > 1)
		return;
	if (outcome && (!outcome->said.tells_standing || !outcome->said.stands))
		visit->end = DB_SCAN_STANDS_NOT;
}

void visit_add_outcome(struct visit *visit, const struct db_inquiry *inquiry,
                       const struct visit_outcome *outcome)
{
	switch (inquiry->kind) {
	case DB_INQUIRY_THERE:
		visit->asked++;
		if (outcome)
			add_presence(visit, outcome);
		visit->unanswered += visit->find.answered == 0;
		if (visit->set_up != DB_INQUIRY_THERE && visit->asked >= asked_at_most(visit) &&
		    (!is_heard(visit) || judge(&visit->find) != DB_SCAN_ONE))
			visit->end = DB_SCAN_NOT_ONE;
		break;
	case DB_INQUIRY_IDENTITY:
		visit->identities = outcome ? visit->identities + 1 : ASKED_IDENTITY;
		visit->identified |= outcome && outcome->answered;
		visit->unidentified += !visit->identified;
		if (outcome) {
			struct db_scan_find *find = &visit->find;
			const char *identity = outcome->said.identity;

			find->doubled += outcome->doubled;
			find->garbled += outcome->garbled;
			if (outcome->answered && !find->identity[0])
				snprintf(find->identity, sizeof(find->identity), "%s", identity);
			else if (outcome->answered && strcmp(find->identity, identity) != 0)
				snprintf(find->other, sizeof(find->other), "%s", identity);
		}
		break;
	case DB_INQUIRY_STANDING:
		add_standing(visit, outcome);
		break;
	default:
		visit->end = !outcome              ? DB_SCAN_REFUSED :
		             !outcome->answered    ? DB_SCAN_SILENT :
		             outcome->said.refused ? DB_SCAN_REFUSED :
		                                     DB_SCAN_DONE;
		break;
	}
}

bool visit_end(struct visit *visit)
{
	if (!is_heard(visit))
		return false;
	visit->find.verdict = judge(&visit->find);
	return true;
}
