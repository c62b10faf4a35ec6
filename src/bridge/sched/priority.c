/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/priority.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>

#define JUDGE_INTERVAL (500 * DB_NS_PER_MS)
/* Twice the interval: a thread that still turns its loop has given the priority back by then. */
#define WITHOUT_SLEEP_US ((rlim_t)(2 * JUDGE_INTERVAL / DB_NS_PER_US))

static int set_priority(unsigned priority)
{
	struct sched_param param = { .sched_priority = (int)priority };

	return pthread_setschedparam(pthread_self(), priority > 0 ? SCHED_FIFO : SCHED_OTHER,
	                             &param);
}

static void limit_time_without_sleep(void)
{
	struct rlimit limit;

	if (getrlimit(RLIMIT_RTTIME, &limit) != 0)
		return;
	limit.rlim_cur = limit.rlim_max < WITHOUT_SLEEP_US ? limit.rlim_max : WITHOUT_SLEEP_US;
	(void)setrlimit(RLIMIT_RTTIME, &limit);
}

/*
 * The kernel sends the signal to the thread that runs, which is the one that has not slept. In
 * other threads it would change nothing. With the signal the kernel raises the limit of all threads
 * by a second: the next one would have the processor longer. Only system calls, so it may interrupt
 * anything.
 */
static void lend_priority(int number)
{
	const struct sched_param none = { .sched_priority = 0 };
	int before = errno;

	(void)number;
	(void)sched_setscheduler(0, SCHED_OTHER, &none);
	limit_time_without_sleep();
	errno = before;
}

/* A loop that hangs is judged by nobody, and on a computer with one processor nothing else would
 * run: neither what tells of it, nor what ends it, nor what stops the drives of other buses. */
static void guard_against_hanging(void)
{
	struct sigaction action = { .sa_handler = lend_priority, .sa_flags = SA_RESTART };

	sigemptyset(&action.sa_mask);
	if (sigaction(SIGXCPU, &action, NULL) == 0)
		limit_time_without_sleep();
}

int priority_begin(struct priority *priority, unsigned wanted, db_time now, db_time used)
{
	int error;

	if (wanted > 0)
		guard_against_hanging();
	error = wanted > 0 ? set_priority(wanted) : 0;

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
	if (priority->held && sched_getscheduler(0) == SCHED_OTHER) {
		priority->held = false;
		return PRIORITY_LOST;
	}
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
