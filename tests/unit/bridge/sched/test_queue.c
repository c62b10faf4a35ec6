/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/queue.h"

#include "fakes/bus.h"

#include <errno.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

static struct db_request request_of(uint32_t ticket, enum db_command command)
{
	return (struct db_request){ .ticket = ticket, .command = command };
}

static void requests_are_taken_in_order_and_answered_once(void **state)
{
	struct db_queue *queue = NULL;
	struct db_request completion;
	struct db_request *first;
	struct db_request *second;
	struct db_request a = request_of(1, DB_CMD_ENABLE);
	struct db_request b = request_of(2, DB_CMD_STOP);

	(void)state;
	assert_int_equal(db_queue_new(2, 1, &queue), 0);
	assert_null(db_queue_take(queue));
	assert_non_null(db_queue_post(queue, &a));
	assert_non_null(db_queue_post(queue, &b));
	assert_false(fake_collect(queue, &completion));
	first = db_queue_take(queue);
	second = db_queue_take(queue);
	assert_int_equal(first->ticket, 1);
	assert_int_equal(second->ticket, 2);
	assert_null(db_queue_take(queue));
	assert_false(db_queue_has_finished(queue));
	db_queue_finish(second, DB_RESULT_OK, 7);
	assert_true(db_queue_has_finished(queue));
	assert_true(fake_collect(queue, &completion));
	assert_int_equal(completion.ticket, 2);
	assert_int_equal(completion.finished, 7);
	assert_false(fake_collect(queue, &completion));
	db_queue_free(queue);
}

static void what_is_gathered_is_seen_at_once(void **state)
{
	struct db_queue *queue = NULL;
	struct db_request stop = request_of(1, DB_CMD_STOP);

	(void)state;
	assert_int_equal(db_queue_new(2, 2, &queue), 0);
	assert_false(db_queue_gather(queue, true));
	assert_false(db_queue_gather(queue, false));
	assert_false(db_queue_gather(queue, true));
	assert_non_null(db_queue_post(queue, &stop));
	assert_null(db_queue_take(queue));
	stop.drive = 1;
	assert_non_null(db_queue_post(queue, &stop));
	assert_null(db_queue_take(queue));
	assert_true(db_queue_gather(queue, false));
	assert_int_equal(db_queue_take(queue)->drive, 0);
	assert_int_equal(db_queue_take(queue)->drive, 1);
	assert_null(db_queue_take(queue));
	/* As ever from here on. */
	assert_non_null(db_queue_post(queue, &stop));
	assert_non_null(db_queue_take(queue));
	db_queue_free(queue);
}

static void a_full_box_still_takes_stops(void **state)
{
	struct db_queue *queue = NULL;
	struct db_request completion;
	struct db_request *collected;
	struct db_request *move_posted;
	struct db_request move = request_of(1, DB_CMD_MOVE_ABSOLUTE);
	struct db_request stop = request_of(9, DB_CMD_QUICK_STOP);

	(void)state;
	assert_int_equal(db_queue_new(2, 1, &queue), 0);
	move_posted = db_queue_post(queue, &move);
	assert_non_null(move_posted);
	assert_non_null(db_queue_post(queue, &move));
	assert_null(db_queue_post(queue, &move));
	for (unsigned i = 0; i < DB_QUEUE_STOPS_EACH; i++)
		assert_non_null(db_queue_post(queue, &stop));
	assert_null(db_queue_post(queue, &stop));
	/* A place is free again only when its result was collected and recorded. */
	db_queue_finish(db_queue_take(queue), DB_RESULT_OK, 1);
	assert_null(db_queue_post(queue, &move));
	collected = db_queue_collect(queue);
	assert_ptr_equal(collected, move_posted);
	assert_null(db_queue_post(queue, &move));
	assert_false(fake_collect(queue, &completion));
	db_queue_release(collected);
	assert_non_null(db_queue_post(queue, &move));
	db_queue_free(queue);
}

/* A stop is nothing but its command; everything else has its values and bytes beside the others'. */
static void every_command_has_room_of_its_own(void **state)
{
	struct db_queue *queue = NULL;
	struct db_setting settings[DB_SETTINGS_MAX];
	struct db_request write = { .setting_count = DB_SETTINGS_MAX, .settings = settings };
	struct db_request stop = request_of(9, DB_CMD_QUICK_STOP);
	struct db_request *slots[3];

	(void)state;
	stop.drive = 5;
	assert_int_equal(db_queue_new(2, 1, &queue), 0);
	for (uint32_t i = 0; i < 2; i++) {
		write.ticket = i + 1;
		for (uint16_t j = 0; j < DB_SETTINGS_MAX; j++)
			settings[j] = (struct db_setting){ .param = j, .value.u = i };
		assert_non_null(db_queue_post(queue, &write));
	}
	assert_non_null(db_queue_post(queue, &stop));
	for (size_t i = 0; i < 3; i++)
		slots[i] = db_queue_take(queue);
	for (uint8_t i = 0; i < 2; i++)
		memset(db_queue_bytes(slots[i]), i + 1, DB_REQUEST_MAX);
	for (uint32_t i = 0; i < 2; i++) {
		const struct db_request *request = slots[i];

		assert_int_equal(request->ticket, i + 1);
		assert_int_equal(slots[i]->command, DB_CMD_NONE);
		assert_int_equal(request->settings[DB_SETTINGS_MAX - 1].param, DB_SETTINGS_MAX - 1);
		assert_int_equal(request->settings[DB_SETTINGS_MAX - 1].value.u, i);
		assert_int_equal(db_queue_bytes(slots[i])[0], i + 1);
		assert_int_equal(db_queue_bytes(slots[i])[DB_REQUEST_MAX - 1], i + 1);
	}
	assert_null(slots[2]->args);
	assert_int_equal(slots[2]->ticket, 9);
	assert_int_equal(slots[2]->drive, 5);
	assert_int_equal(slots[2]->command, DB_CMD_QUICK_STOP);
	db_queue_free(queue);
}

static void nobody_takes_the_room_for_anothers_stops(void **state)
{
	struct db_queue *queue = NULL;
	struct db_request dead = request_of(1, DB_CMD_STOP);
	struct db_request living = request_of(2, DB_CMD_DISABLE);
	unsigned posted = 0;

	(void)state;
	dead.drive = 1;
	living.drive = 2;
	assert_int_equal(db_queue_new(2, 2, &queue), 0);
	while (posted < 100 && db_queue_post(queue, &dead)) {
		assert_non_null(db_queue_take(queue)); /* and never finished */
		posted++;
	}
	assert_int_equal(posted, DB_QUEUE_STOPS_EACH);
	for (unsigned i = 0; i < DB_QUEUE_STOPS_EACH; i++)
		assert_non_null(db_queue_post(queue, &living));
	db_queue_free(queue);
}

#define REQUESTS 20000

static void *work(void *context)
{
	struct db_queue *queue = context;
	uint32_t expected = 1;

	while (expected <= REQUESTS) {
		struct db_request *request = db_queue_take(queue);

		if (!request)
			continue;
		if (request->ticket != expected)
			return (void *)1;
		expected++;
		db_queue_finish(request, DB_RESULT_OK, 1);
	}
	return NULL;
}

static void two_threads_lose_and_reorder_nothing(void **state)
{
	struct db_queue *queue = NULL;
	struct db_request completion;
	uint32_t collected = 0;
	uint32_t posted = 0;
	pthread_t thread;
	void *failed;

	(void)state;
	assert_int_equal(db_queue_new(5, 3, &queue), 0);
	assert_int_equal(pthread_create(&thread, NULL, work, queue), 0);
	while (collected < REQUESTS) {
		/* It may grow all the while. */
		if (posted % 1000 == 0)
			assert_int_equal(db_queue_grow(queue, 3 + posted / 1000), 0);
		struct db_request request = request_of(posted + 1,
		                                       posted % 3 ? DB_CMD_ENABLE : DB_CMD_STOP);

		if (posted < REQUESTS && db_queue_post(queue, &request))
			posted++;
		while (fake_collect(queue, &completion))
			collected++;
	}
	pthread_join(thread, &failed);
	assert_null(failed);
	db_queue_free(queue);
}

static void it_grows_for_stops_and_never_shrinks(void **state)
{
	struct db_queue *queue = NULL;
	struct db_request completion;
	struct db_request move = request_of(1, DB_CMD_MOVE_ABSOLUTE);
	unsigned requests = 1 + 3 * DB_QUEUE_STOPS_EACH;

	(void)state;
	assert_int_equal(db_queue_new(1, 1, &queue), 0);
	assert_int_equal(db_queue_grow(queue, 3), 0);
	assert_int_equal(db_queue_grow(queue, 2), 0);
	assert_non_null(db_queue_post(queue, &move));
	assert_null(db_queue_post(queue, &move));
	for (unsigned i = 0; i < 3 * DB_QUEUE_STOPS_EACH; i++) {
		struct db_request stop = request_of(9, DB_CMD_STOP);

		stop.drive = (uint16_t)(i % 3);
		assert_non_null(db_queue_post(queue, &stop));
		if (i >= 3 * DB_QUEUE_STOPS_EACH - 3)
			assert_null(db_queue_post(queue, &stop));
	}
	move.drive = 3;
	move.command = DB_CMD_STOP;
	assert_null(db_queue_post(queue, &move));
	for (unsigned i = 0; i < requests; i++)
		db_queue_finish(db_queue_take(queue), DB_RESULT_OK, 1);
	assert_null(db_queue_take(queue));
	for (unsigned i = 0; i < requests; i++)
		assert_true(fake_collect(queue, &completion));
	assert_false(fake_collect(queue, &completion));
	db_queue_free(queue);
}

/* The caller may post a copy of a request that has ended. */
static void a_posted_request_has_its_values_and_nothing_of_an_earlier_end(void **state)
{
	const struct db_args args = { .target_position = 77 };
	static const struct db_args none;
	struct db_request request = { .command = DB_CMD_ENABLE, .args = &args };
	struct db_request *posted;
	struct db_queue *queue = NULL;

	(void)state;
	request.result = DB_RESULT_OK;
	request.sent = request.finished = 5;
	atomic_store(&request.acknowledged, true);
	atomic_store(&request.stop_follows, true);
	assert_int_equal(db_queue_new(1, 1, &queue), 0);
	for (unsigned stop = 0; stop < 2; stop++) {
		request.command = stop ? DB_CMD_STOP : DB_CMD_ENABLE;
		posted = db_queue_post(queue, &request);
		assert_non_null(posted);
		assert_int_equal(posted->result, DB_RESULT_PENDING);
		assert_int_equal(posted->sent, 0);
		assert_int_equal(posted->finished, 0);
		assert_false(atomic_load(&posted->acknowledged));
		assert_false(atomic_load(&posted->stop_follows));
		if (stop)
			assert_null(posted->args);
		else
			assert_int_equal(posted->args->target_position, 77);
		assert_ptr_equal(db_queue_take(queue), posted);
		/* Only the first sending is noted, and the end is told only once. */
		db_queue_note_sent(posted, 3);
		db_queue_note_sent(posted, 4);
		assert_int_equal(posted->sent, 3);
		db_queue_finish(posted, DB_RESULT_OK, 1);
		assert_true(db_queue_has_finished(queue));
		assert_false(db_queue_has_finished(queue));
		assert_ptr_equal(db_queue_collect(queue), posted);
		db_queue_release(posted);
	}
	request = request_of(1, DB_CMD_ENABLE);
	posted = db_queue_post(queue, &request);
	assert_non_null(posted);
	assert_memory_equal(posted->args, &none, sizeof none);
	db_queue_free(queue);
}

/* A write of one setting has memory of its own for it; of too many settings the rest is dropped; a
 * stop has no settings. */
static void settings_are_copied_as_far_as_there_is_room(void **state)
{
	struct db_setting settings[DB_SETTINGS_MAX + 1] = { { .param = 7 }, { .param = 8 } };
	struct db_request write = { .settings = settings, .setting_count = 1 };
	struct db_request *posted;
	struct db_queue *queue = NULL;
	unsigned char there;
	void *page;

	(void)state;
	assert_int_equal(db_queue_new(2, 1, &queue), 0);
	posted = db_queue_post(queue, &write);
	assert_non_null(posted);
	page = (void *)((uintptr_t)posted->settings & ~(uintptr_t)(sysconf(_SC_PAGESIZE) - 1));
	assert_ptr_not_equal(posted->settings, settings);
	assert_int_equal(posted->settings[0].param, 7);
	write.setting_count = DB_SETTINGS_MAX + 1;
	posted = db_queue_post(queue, &write);
	assert_non_null(posted);
	assert_int_equal(posted->settings[1].param, 8);
	write.command = DB_CMD_STOP;
	posted = db_queue_post(queue, &write);
	assert_non_null(posted);
	assert_null(posted->settings);
	db_queue_free(queue);
	/* The queue has given back the memory of the settings. */
	assert_int_equal(mincore(page, 1, &there), -1);
	assert_int_equal(errno, ENOMEM);
}

static void a_write_that_was_joined_is_not_joined_to_a_later_one(void **state)
{
	const struct db_setting setting = { .param = 7 };
	const struct db_request write = { .settings = &setting, .setting_count = 1 };
	struct db_request *first;
	struct db_request *second;
	struct db_queue *queue = NULL;

	(void)state;
	assert_int_equal(db_queue_new(2, 1, &queue), 0);
	for (unsigned joins = 2; joins-- > 0;) {
		assert_non_null(db_queue_post(queue, &write));
		assert_non_null(db_queue_post(queue, &write));
		first = db_queue_take(queue);
		second = db_queue_take(queue);
		if (joins)
			db_queue_join(first, second);
		db_queue_finish(first, DB_RESULT_OK, 1);
		assert_ptr_equal(db_queue_collect(queue), first);
		db_queue_release(first);
		if (joins) {
			assert_ptr_equal(db_queue_collect(queue), second);
			db_queue_release(second);
		}
	}
	assert_null(db_queue_collect(queue));
	db_queue_free(queue);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(requests_are_taken_in_order_and_answered_once),
		cmocka_unit_test(what_is_gathered_is_seen_at_once),
		cmocka_unit_test(a_full_box_still_takes_stops),
		cmocka_unit_test(nobody_takes_the_room_for_anothers_stops),
		cmocka_unit_test(every_command_has_room_of_its_own),
		cmocka_unit_test(a_posted_request_has_its_values_and_nothing_of_an_earlier_end),
		cmocka_unit_test(settings_are_copied_as_far_as_there_is_room),
		cmocka_unit_test(a_write_that_was_joined_is_not_joined_to_a_later_one),
		cmocka_unit_test(it_grows_for_stops_and_never_shrinks),
		cmocka_unit_test(two_threads_lose_and_reorder_nothing),
	};

	return cmocka_run_group_tests_name("queue", tests, NULL, NULL);
}
