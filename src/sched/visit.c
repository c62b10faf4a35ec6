/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/visit.h"

#include <stdio.h>
#include <string.h>

/* So often a silent address is asked, and one from which something came: drives that share an address do not
 * talk at once every time. */
#define ASKED_SILENT 2
#define ASKED_HEARD 5
#define ASKED_IDENTITY 3
/* Where a drive is told something, fewer are enough: it was looked for before. */
#define ASKED_SET_UP 3

/* Damage that comes once is the line's, and an answer too many once is a late one. */
#define OFTEN 2

/* A question whether it stands is asked so often until it is answered. */
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
	return visit->set_up == DB_INQUIRY_THERE ? ASKED_HEARD : ASKED_SET_UP;
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
		return true;
	}
	if (visit->find.answered == 0)
		return false;
	if (visit->set_up == DB_INQUIRY_THERE) {
		inquiry->kind = DB_INQUIRY_IDENTITY;
		return visit->identities < ASKED_IDENTITY;
	}
	if (visit->standings < visit->axes) {
		inquiry->kind = DB_INQUIRY_STANDING;
		inquiry->value = visit->standings;
		return true;
	}
	inquiry->kind = visit->set_up;
	inquiry->value = visit->value;
	return !visit->told;
}

static void count_outcome(struct db_scan_find *find, const struct visit_outcome *outcome)
{
	find->asked++;
	find->answered += outcome->answered;
	find->doubled += outcome->doubled;
	find->garbled += outcome->garbled;
}

static void take_time(struct visit *visit, uint32_t time_us)
{
	struct db_scan_find *find = &visit->find;

	visit->time_sum_us += time_us;
	if (find->time_min_us == 0 || time_us < find->time_min_us)
		find->time_min_us = time_us;
	if (time_us > find->time_max_us)
		find->time_max_us = time_us;
	find->time_mean_us = (uint32_t)(visit->time_sum_us / find->answered);
}

static void take_identity(struct db_scan_find *find, const char *identity)
{
	if (!find->identity[0])
		snprintf(find->identity, sizeof find->identity, "%s", identity);
	else if (strcmp(find->identity, identity) != 0)
		snprintf(find->other, sizeof find->other, "%s", identity);
}

static void take_standing(struct visit *visit, const struct visit_outcome *outcome)
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

static void take_set_up(struct visit *visit, const struct visit_outcome *outcome)
{
	visit->told = true;
	visit->end = !outcome              ? DB_SCAN_REFUSED :
	             !outcome->answered    ? DB_SCAN_SILENT :
	             outcome->said.refused ? DB_SCAN_REFUSED :
	                                     DB_SCAN_DONE;
}

void visit_take(struct visit *visit, const struct db_inquiry *inquiry,
                const struct visit_outcome *outcome)
{
	switch (inquiry->kind) {
	case DB_INQUIRY_THERE:
		visit->asked++;
		if (outcome)
			count_outcome(&visit->find, outcome);
		if (outcome && outcome->answered)
			take_time(visit, outcome->time_us);
		if (visit->set_up != DB_INQUIRY_THERE && visit->asked >= asked_at_most(visit) &&
		    (!is_heard(visit) || judge(&visit->find) != DB_SCAN_ONE))
			visit->end = DB_SCAN_NOT_ONE;
		break;
	case DB_INQUIRY_IDENTITY:
		visit->identities = outcome ? visit->identities + 1 : ASKED_IDENTITY;
		if (outcome && outcome->answered)
			take_identity(&visit->find, outcome->said.identity);
		if (outcome) {
			visit->find.doubled += outcome->doubled;
			visit->find.garbled += outcome->garbled;
		}
		break;
	case DB_INQUIRY_STANDING:
		take_standing(visit, outcome);
		break;
	default:
		take_set_up(visit, outcome);
		break;
	}
}

void visit_ask_standing_again(struct visit *visit)
{
	visit->standings = visit->standing_tries = 0;
}

bool visit_end(struct visit *visit)
{
	if (!is_heard(visit))
		return false;
	visit->find.verdict = judge(&visit->find);
	return true;
}
