/* SPDX-License-Identifier: Apache-2.0 */
/* Who takes too much of a processor does without real-time priority, and has it back behind that. */
#include "sched/priority.h"

#include "drivebridge/clock.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define WANTED 3
#define SECOND DB_NS_PER_S

/* The kernel's word: pthread_getschedparam() remembers what it has set itself. */
static int policy(void)
{
	return sched_getscheduler(0);
}

static bool is_guarded(void)
{
	struct sigaction action;

	assert_int_equal(sigaction(SIGXCPU, NULL, &action), 0);
	return action.sa_handler != SIG_DFL;
}

static void test_none_is_asked_for(void **state)
{
	struct priority priority;

	(void)state;
	assert_int_equal(priority_begin(&priority, 0, SECOND, 0), 0);
	assert_int_equal(policy(), SCHED_OTHER);
	assert_false(priority.held);
	assert_false(priority_is_due(&priority, 100 * SECOND));
	/* A thread without a priority needs no handler for the signal against hanging. */
	assert_false(is_guarded());
}

static void test_none_is_allowed(void **state)
{
	struct priority priority;

	(void)state;
	/* No system has this one. */
	assert_int_equal(priority_begin(&priority, 1000, SECOND, 0), EINVAL);
	assert_int_equal(policy(), SCHED_OTHER);
	assert_false(priority.held);
	assert_false(priority_is_due(&priority, 100 * SECOND));
}

static void test_the_lowest_priority_is_given(void **state)
{
	struct priority priority;

	(void)state;
	(void)signal(SIGXCPU, SIG_DFL);
	if (priority_begin(&priority, 1, SECOND, 0) == EPERM)
		skip();
	assert_int_equal(policy(), SCHED_FIFO);
	assert_true(priority.held);
	assert_true(is_guarded());
	assert_true(priority_is_due(&priority, 100 * SECOND));
}

static void test_too_much_is_lent(void **state)
{
	struct priority priority;
	db_time now = SECOND;
	db_time used = SECOND / 10;

	(void)state;
	if (priority_begin(&priority, WANTED, now, used) == EPERM)
		skip();
	assert_int_equal(policy(), SCHED_FIFO);
	assert_false(priority_is_due(&priority, now + SECOND / 2 - 1));
	assert_true(priority_is_due(&priority, now + SECOND / 2));

	/* Half of it is not more than half. */
	assert_int_equal(priority_judge(&priority, now += SECOND, used += SECOND / 2),
	                 PRIORITY_AS_BEFORE);
	assert_int_equal(policy(), SCHED_FIFO);
	assert_int_equal(priority_judge(&priority, now += SECOND, used += SECOND / 2 + 1),
	                 PRIORITY_GIVEN_UP);
	assert_int_equal(policy(), SCHED_OTHER);
	/* Only far below it comes back: others may be what kept the thread below half. */
	assert_int_equal(priority_judge(&priority, now += SECOND, used += SECOND / 4),
	                 PRIORITY_AS_BEFORE);
	assert_int_equal(policy(), SCHED_OTHER);
	assert_int_equal(priority_judge(&priority, now += SECOND, used += SECOND / 4 - 1),
	                 PRIORITY_RESTORED);
	assert_int_equal(policy(), SCHED_FIFO);
	assert_false(priority_is_due(&priority, now));
	assert_int_equal(priority_begin(&priority, 0, now, used), 0);
}

/* Where nothing else of this processor would run, and nobody judges any more. */
static void test_a_thread_that_hangs_loses_it(void **state)
{
	struct priority priority;
	db_time began;
	db_time now = SECOND;

	(void)state;
	if (priority_begin(&priority, WANTED, now, 0) == EPERM)
		skip();
	/* The second time as soon as the first: the limit is not a longer one then. */
	for (unsigned times = 0; times < 2; times++) {
		assert_int_equal(policy(), SCHED_FIFO);
		began = db_clock_read(CLOCK_THREAD_CPUTIME_ID);
		while (policy() == SCHED_FIFO &&
		       db_clock_read(CLOCK_THREAD_CPUTIME_ID) - began < 10 * SECOND)
			;
		assert_int_equal(policy(), SCHED_OTHER);
		assert_in_range(db_clock_read(CLOCK_THREAD_CPUTIME_ID) - began, SECOND / 2,
		                SECOND * 8 / 5);

		/* It goes on after all: that is told, and it has the priority again as after too
		 * much work. */
		assert_int_equal(priority_judge(&priority, now += SECOND, 0), PRIORITY_LOST);
		assert_int_equal(policy(), SCHED_OTHER);
		assert_int_equal(priority_judge(&priority, now += SECOND, 0), PRIORITY_RESTORED);
		/* The kernel counts from the last sleep. */
		(void)poll(NULL, 0, 1);
	}
	assert_int_equal(policy(), SCHED_FIFO);
}

/* What a test leaves is nobody else's. */
static int reset(void **state)
{
	const struct sched_param none = { .sched_priority = 0 };

	(void)state;
	return pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_none_is_asked_for),
		cmocka_unit_test(test_none_is_allowed),
		cmocka_unit_test_teardown(test_the_lowest_priority_is_given, reset),
		cmocka_unit_test_teardown(test_too_much_is_lent, reset),
		cmocka_unit_test_teardown(test_a_thread_that_hangs_loses_it, reset),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
