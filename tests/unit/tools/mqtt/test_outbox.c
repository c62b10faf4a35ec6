/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/outbox.h"
#include "mqtt/retry.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MESSAGES 100
#define BYTES 65536

static int open_outbox(void **state)
{
	*state = db_mqtt_outbox_new(MESSAGES, BYTES);
	return *state ? 0 : -1;
}

static int close_outbox(void **state)
{
	db_mqtt_outbox_free(*state);
	return 0;
}

static void add(struct db_mqtt_outbox *outbox, int number)
{
	char text[32];

	(void)snprintf(text, sizeof(text), "%d", number);
	db_mqtt_outbox_add_sample(outbox, DB_MQTT_USUAL, "changes", text);
}

/* Sends one, and expects it to be that. */
static void send_number(struct db_mqtt_outbox *outbox, int expected, int number)
{
	struct db_mqtt_message message;

	assert_true(db_mqtt_outbox_next(outbox, &message));
	assert_string_equal(message.topic, "changes");
	assert_int_equal(atoi(message.payload), expected);
	assert_false(message.retained);
	db_mqtt_outbox_sent(outbox, number);
}

static void test_samples_leave_in_their_order(void **state)
{
	struct db_mqtt_message message;

	for (int i = 0; i < 3; i++)
		add(*state, i);
	for (int i = 0; i < 3; i++)
		send_number(*state, i, 10 + i);
	assert_false(db_mqtt_outbox_next(*state, &message));
	for (int i = 3; i-- > 0;)
		db_mqtt_outbox_confirm(*state, 10 + i);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).bytes, 0);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).confirmed, 3);
	/* A confirmation of nothing. */
	db_mqtt_outbox_confirm(*state, 10);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).confirmed, 3);
}

static void test_so_many_are_on_their_way(void **state)
{
	struct db_mqtt_message message;

	for (int i = 0; i < DB_MQTT_WINDOW + 1; i++)
		add(*state, i);
	for (int i = 0; i < DB_MQTT_WINDOW; i++)
		send_number(*state, i, i + 1);
	assert_false(db_mqtt_outbox_next(*state, &message));
	db_mqtt_outbox_confirm(*state, 5);
	send_number(*state, DB_MQTT_WINDOW, 99);
}

static void test_a_lost_connection_loses_nothing(void **state)
{
	for (int i = 0; i < 5; i++)
		add(*state, i);
	for (int i = 0; i < 4; i++)
		send_number(*state, i, i + 1);
	db_mqtt_outbox_confirm(*state, 2);
	db_mqtt_outbox_start_over(*state);
	send_number(*state, 0, 7);
	send_number(*state, 2, 8);
	send_number(*state, 3, 9);
	send_number(*state, 4, 10);
}

static void test_the_oldest_go_and_are_counted(void **state)
{
	send_number((add(*state, -1), *state), -1, 1);
	for (int i = 0; i < MESSAGES + 7; i++)
		add(*state, i);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).dropped, 7);
	/* Not what was on its way. */
	db_mqtt_outbox_start_over(*state);
	send_number(*state, -1, 2);
	send_number(*state, 7, 3);
}

static void test_bytes_are_bounded(void **state)
{
	char *text = calloc(1, BYTES + 1);

	assert_non_null(text);
	memset(text, 'x', BYTES / 4);
	for (int i = 0; i < 9; i++) {
		db_mqtt_outbox_add_sample(*state, DB_MQTT_USUAL, "changes", text);
		assert_true(db_mqtt_outbox_read_stats(*state).bytes <= BYTES);
	}
	assert_int_equal(db_mqtt_outbox_read_stats(*state).messages, 3);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).dropped, 6);
	/* One that can never fit takes the place of none that could. */
	memset(text, 'x', BYTES);
	db_mqtt_outbox_add_sample(*state, DB_MQTT_USUAL, "changes", text);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).dropped, 10);
	free(text);
}

static void test_of_a_retained_topic_the_latest_counts(void **state)
{
	struct db_mqtt_message message;

	db_mqtt_outbox_set_retained(*state, "state", "old");
	db_mqtt_outbox_set_retained(*state, "state", "new");
	add(*state, 1);
	assert_true(db_mqtt_outbox_next(*state, &message));
	assert_true(message.retained);
	assert_string_equal(message.payload, "new");
	db_mqtt_outbox_sent(*state, 1);
	db_mqtt_outbox_set_retained(*state, "state", "newest");
	/* Behind the confirmation of the one before. */
	send_number(*state, 1, 2);
	assert_false(db_mqtt_outbox_next(*state, &message));
	db_mqtt_outbox_confirm(*state, 1);
	assert_true(db_mqtt_outbox_next(*state, &message));
	assert_string_equal(message.payload, "newest");
	db_mqtt_outbox_sent(*state, 0);
	assert_false(db_mqtt_outbox_next(*state, &message));
	/* Another connection: the broker may have forgotten it. */
	db_mqtt_outbox_start_over(*state);
	assert_true(db_mqtt_outbox_next(*state, &message));
	assert_string_equal(message.payload, "newest");
}

static void test_without_confirmations(void **state)
{
	struct db_mqtt_message message;

	for (int i = 0; i < 40; i++) {
		add(*state, i);
		assert_true(db_mqtt_outbox_next(*state, &message));
		assert_int_equal(atoi(message.payload), i);
		db_mqtt_outbox_sent(*state, 0);
	}
	assert_int_equal(db_mqtt_outbox_read_stats(*state).bytes, 0);
}

/* --- 72 hours --------------------------------------------------------------------------------- */

/* A broker that comes and goes. */
struct weather {
	db_time until;
	bool up;
	uint32_t seed;
};

static uint32_t roll(struct weather *weather)
{
	weather->seed = weather->seed * 1664525U + 1013904223U;
	return weather->seed >> 8;
}

static void blow(struct weather *weather, db_time now)
{
	if (now < weather->until)
		return;
	weather->up = !weather->up;
	/* Away for up to 50 minutes, there for up to two hours. */
	weather->until = now + (db_time)(roll(weather) % (weather->up ? 7200 : 3000)) * DB_NS_PER_S;
}

/* Eight drives every 5 s through a broker that comes and goes, and is slow: what arrives is in its order, each number is
 * confirmed or counted as dropped, and the memory stays within its bounds. */
static void test_72_hours(void **state)
{
	struct weather weather = { .seed = 17 };
	struct db_mqtt_retry retry = { .due = 0 };
	uint64_t added = 0, arrived = 0, attempts = 0;
	int last = -1, mail = 1, oldest = 1;
	bool connected = false;

	for (db_time now = 0; now < 72 * 3600 * DB_NS_PER_S; now += 5 * DB_NS_PER_S) {
		struct db_mqtt_message message;

		blow(&weather, now);
		if (connected && !weather.up) {
			connected = false;
			db_mqtt_retry_fail(&retry, now, roll(&weather));
		} else if (!connected && now >= retry.due) {
			attempts++;
			connected = weather.up;
			if (connected) {
				retry = (struct db_mqtt_retry){ .due = 0 };
				db_mqtt_outbox_start_over(*state);
				oldest = mail;
			} else {
				db_mqtt_retry_fail(&retry, now, roll(&weather));
			}
		}
		for (int drive = 0; drive < 8; drive++)
			add(*state, (int)added++);
		for (uint32_t room = roll(&weather) % 40;
		     connected && room > 0 && db_mqtt_outbox_next(*state, &message); room--) {
			int number = atoi(message.payload);

			/* Again only what was not confirmed before the connection was lost. */
			assert_true(number > last || number >= last - DB_MQTT_WINDOW);
			last = number > last ? number : last;
			db_mqtt_outbox_sent(*state, mail++);
		}
		while (connected && oldest < mail && roll(&weather) % 8 != 0) {
			db_mqtt_outbox_confirm(*state, oldest++);
			arrived++;
		}
		assert_true(db_mqtt_outbox_read_stats(*state).messages <=
		            MESSAGES + DB_MQTT_WINDOW);
		assert_true(db_mqtt_outbox_read_stats(*state).bytes <= BYTES);
	}
	db_mqtt_outbox_start_over(*state);
	assert_int_equal(arrived + db_mqtt_outbox_read_stats(*state).dropped +
	                         db_mqtt_outbox_read_stats(*state).messages,
	                 added);
	assert_true(arrived > added / 4 && db_mqtt_outbox_read_stats(*state).dropped > 1000);
	/* Not more often than once a minute in the long run, and not much less often. */
	assert_in_range(attempts, 300, 72 * 60);
}

static void send_text(struct db_mqtt_outbox *outbox, const char *expected, int number)
{
	struct db_mqtt_message message;

	assert_true(db_mqtt_outbox_next(outbox, &message));
	assert_string_equal(message.payload, expected);
	db_mqtt_outbox_sent(outbox, number);
}

/* What became of a command overtakes values, and both what was refused; also behind a lost connection. */
static void test_lanes(void **state)
{
	db_mqtt_outbox_add_sample(*state, DB_MQTT_LAST, "result", "refused");
	db_mqtt_outbox_add_sample(*state, DB_MQTT_USUAL, "changes", "value");
	db_mqtt_outbox_add_sample(*state, DB_MQTT_PROMPT, "result", "ok");
	send_text(*state, "ok", 1);
	send_text(*state, "value", 2);
	db_mqtt_outbox_add_sample(*state, DB_MQTT_PROMPT, "result", "ok2");
	db_mqtt_outbox_start_over(*state);
	send_text(*state, "ok", 3);
	send_text(*state, "ok2", 4);
	send_text(*state, "value", 5);
	send_text(*state, "refused", 6);
}

/* Where there is no room, what matters least goes first, and never for something that matters less. */
static void test_what_is_dropped(void **state)
{
	for (int i = 0; i < MESSAGES / 2; i++)
		db_mqtt_outbox_add_sample(*state, DB_MQTT_LAST, "result", "refused");
	for (int i = 0; i < MESSAGES; i++)
		add(*state, i);
	assert_int_equal(db_mqtt_outbox_read_stats(*state).dropped, MESSAGES / 2);
	db_mqtt_outbox_add_sample(*state, DB_MQTT_LAST, "result", "refused");
	assert_int_equal(db_mqtt_outbox_read_stats(*state).dropped, MESSAGES / 2 + 1);
	db_mqtt_outbox_add_sample(*state, DB_MQTT_PROMPT, "result", "ok");
	send_text(*state, "ok", 1);
	send_text(*state, "1", 2);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_lanes, open_outbox, close_outbox),
		cmocka_unit_test_setup_teardown(test_what_is_dropped, open_outbox, close_outbox),
		cmocka_unit_test_setup_teardown(test_samples_leave_in_their_order, open_outbox,
		                                close_outbox),
		cmocka_unit_test_setup_teardown(test_so_many_are_on_their_way, open_outbox,
		                                close_outbox),
		cmocka_unit_test_setup_teardown(test_a_lost_connection_loses_nothing, open_outbox,
		                                close_outbox),
		cmocka_unit_test_setup_teardown(test_the_oldest_go_and_are_counted, open_outbox,
		                                close_outbox),
		cmocka_unit_test_setup_teardown(test_bytes_are_bounded, open_outbox, close_outbox),
		cmocka_unit_test_setup_teardown(test_of_a_retained_topic_the_latest_counts,
		                                open_outbox, close_outbox),
		cmocka_unit_test_setup_teardown(test_without_confirmations, open_outbox,
		                                close_outbox),
		cmocka_unit_test_setup_teardown(test_72_hours, open_outbox, close_outbox),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
