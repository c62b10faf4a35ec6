/* SPDX-License-Identifier: Apache-2.0 */
#include "client/events.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

struct event {
	int number;
	int time_us;
};

#define SKIPPED(seen, ...)                                         \
	count_skipped(seen, (const struct event[]){ __VA_ARGS__ }, \
	              sizeof((struct event[]){ __VA_ARGS__ }) / sizeof(struct event))

static size_t count_skipped(struct db_client_events *seen, const struct event *list, size_t count)
{
	json_t *events = json_array();
	size_t skipped;

	for (size_t i = 0; i < count; i++)
		(void)json_array_append_new(events,
		                            json_pack("{s:i, s:i}", "number", list[i].number,
		                                      "time_us", list[i].time_us));
	skipped = db_client_events_skip(seen, events);
	json_decref(events);
	return skipped;
}

static void what_was_before_the_program_is_no_news(void **state)
{
	struct db_client_events seen = { .from_us = 100 };

	(void)state;
	assert_int_equal(SKIPPED(&seen, { 1, 10 }, { 2, 99 }, { 3, 100 }), 2);
	assert_int_equal(SKIPPED(&seen, { 4, 101 }), 0);
}

static void a_clock_set_back_hides_nothing(void **state)
{
	struct db_client_events seen = { .from_us = 100 };

	(void)state;
	assert_int_equal(SKIPPED(&seen, { 1, 50 }, { 2, 70 }), 2);
	assert_int_equal(SKIPPED(&seen, { 3, 20 }), 0);
	seen.connected = false;
	assert_int_equal(SKIPPED(&seen, { 1, 50 }, { 2, 70 }, { 3, 20 }, { 4, 15 }), 3);
	assert_int_equal(SKIPPED(&seen, { 5, 16 }, { 6, 16 }), 0);
}

static void what_happened_without_a_connection_is_news(void **state)
{
	struct db_client_events seen = { .from_us = 0 };

	(void)state;
	assert_int_equal(SKIPPED(&seen, { 1, 10 }, { 2, 20 }), 0);
	seen.connected = false;
	assert_int_equal(SKIPPED(&seen, { 2, 20 }, { 3, 20 }, { 4, 30 }), 1);
	/* So many that the latest is forgotten. */
	seen.connected = false;
	assert_int_equal(SKIPPED(&seen, { 300, 40 }, { 301, 50 }), 0);
}

static void a_service_started_anew_tells_all_from_its_start(void **state)
{
	struct db_client_events seen = { .from_us = 0 };

	(void)state;
	assert_int_equal(SKIPPED(&seen, { 1, 10 }, { 2, 20 }), 0);
	seen.connected = false;
	assert_int_equal(SKIPPED(&seen, { 1, 30 }, { 2, 31 }, { 3, 32 }), 0);
	seen.connected = false;
	assert_int_equal(count_skipped(&seen, NULL, 0), 0);
	assert_int_equal(SKIPPED(&seen, { 4, 33 }), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_was_before_the_program_is_no_news),
		cmocka_unit_test(a_clock_set_back_hides_nothing),
		cmocka_unit_test(what_happened_without_a_connection_is_news),
		cmocka_unit_test(a_service_started_anew_tells_all_from_its_start),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
