/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/priority.h"

#include <pthread.h>
#include <sched.h>

#define JUDGE_INTERVAL (500 * DB_NS_PER_MS)

static int set_priority(unsigned priority)
{
	struct sched_param param = { .sched_priority = (int)priority };

	return pthread_setschedparam(pthread_self(), priority > 0 ? SCHED_FIFO : SCHED_OTHER,
	                             &param);
}

int priority_begin(struct priority *priority, unsigned wanted, db_time now, db_time used)
{
	int error = wanted > 0 ? set_priority(wanted) : 0;

	*priority = (struct priority){
		.wanted = error == 0 ? wanted : 0,
		.held = error == 0 && wanted > 0,
		.judged_at = now,
		.used = used,
	};
	return error;
}

bool priority_is_due(const struct priority *priority, db_time now)
{
	return priority->wanted > 0 && now - priority->judged_at >= JUDGE_INTERVAL;
}

enum priority_change priority_judge(struct priority *priority, db_time now, db_time used)
{
	db_time passed = now - priority->judged_at;
	db_time took = used - priority->used;

	priority->judged_at = now;
	priority->used = used;
	if (priority->held && took > passed / 2) {
		priority->held = set_priority(0) != 0;
		return priority->held ? PRIORITY_AS_BEFORE : PRIORITY_GIVEN_UP;
	}
	if (!priority->held && took < passed / 4) {
		priority->held = set_priority(priority->wanted) == 0;
		return priority->held ? PRIORITY_RESTORED : PRIORITY_AS_BEFORE;
	}
	return PRIORITY_AS_BEFORE;
}
