/* SPDX-License-Identifier: Apache-2.0 */
/* Who takes too much of a processor does without real-time priority, and has it back behind that. */
#include "sched/priority.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define WANTED 3
#define SECOND DB_NS_PER_S

static int policy(void)
{
	struct sched_param param;
	int found;

	assert_int_equal(pthread_getschedparam(pthread_self(), &found, &param), 0);
	return found;
}

static void test_none_is_asked_for(void **state)
{
	struct priority priority;

	(void)state;
	assert_int_equal(priority_begin(&priority, 0, SECOND, 0), 0);
	assert_int_equal(policy(), SCHED_OTHER);
	assert_false(priority_is_due(&priority, 100 * SECOND));
}

static void test_none_is_allowed(void **state)
{
	struct priority priority;

	(void)state;
	/* No system has this one. */
	assert_int_equal(priority_begin(&priority, 1000, SECOND, 0), EINVAL);
	assert_int_equal(policy(), SCHED_OTHER);
	assert_false(priority_is_due(&priority, 100 * SECOND));
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
		cmocka_unit_test_teardown(test_too_much_is_lent, reset),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
