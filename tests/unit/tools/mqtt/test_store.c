/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/store.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MESSAGES 10
#define BYTES 2000

static int open_store(void **state)
{
	*state = db_mqtt_store_new(MESSAGES, BYTES);
	return *state ? 0 : -1;
}

static int close_store(void **state)
{
	db_mqtt_store_free(*state);
	return 0;
}

static void add(struct db_mqtt_store *store, enum db_mqtt_shelf shelf, const char *device,
                uint8_t number)
{
	db_mqtt_store_add(store, shelf, device, &number, 1);
}

/* The first of the shelf is that one, marked or not. */
static void expect(const struct db_mqtt_store *store, enum db_mqtt_shelf shelf, int number,
                   bool historical)
{
	const struct db_mqtt_stored *stored = db_mqtt_store_first(store, shelf);

	assert_non_null(stored);
	assert_int_equal(stored->metrics[0], number);
	assert_int_equal(stored->historical, historical);
}

static void test_a_lost_session_is_told_later(void **state)
{
	struct db_mqtt_store *store = *state;

	add(store, DB_MQTT_SHELF_NOW, "a", 1);
	add(store, DB_MQTT_SHELF_NOW, "a", 2);
	add(store, DB_MQTT_SHELF_NOW, "a", 3);
	expect(store, DB_MQTT_SHELF_NOW, 1, false);
	db_mqtt_store_sent(store, DB_MQTT_SHELF_NOW, 100);
	db_mqtt_store_sent(store, DB_MQTT_SHELF_NOW, 200);
	assert_int_equal(db_mqtt_store_read_stats(store).messages, 1);
	/* The first one has arrived, the second one may not have. */
	db_mqtt_store_settle(store, 150);
	db_mqtt_store_end(store, true);
	assert_null(db_mqtt_store_first(store, DB_MQTT_SHELF_NOW));
	for (int number = 2; number <= 3; number++) {
		expect(store, DB_MQTT_SHELF_LATER, number, true);
		db_mqtt_store_sent(store, DB_MQTT_SHELF_LATER, 300);
	}
	assert_null(db_mqtt_store_first(store, DB_MQTT_SHELF_LATER));
	/* After a farewell all has arrived. */
	db_mqtt_store_end(store, false);
	assert_int_equal(db_mqtt_store_read_stats(store).bytes, 0);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 0);
}

static void test_the_oldest_goes(void **state)
{
	struct db_mqtt_store *store = *state;

	add(store, DB_MQTT_SHELF_LATER, "dead", 0);
	db_mqtt_store_park(store);
	for (uint8_t number = 1; number < MESSAGES; number++)
		add(store, DB_MQTT_SHELF_LATER, "a", number);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 0);
	add(store, DB_MQTT_SHELF_NOW, "a", 50);
	assert_null(db_mqtt_store_first(store, DB_MQTT_SHELF_PARKED));
	add(store, DB_MQTT_SHELF_NOW, "a", 51);
	expect(store, DB_MQTT_SHELF_LATER, 2, true);
	expect(store, DB_MQTT_SHELF_NOW, 50, false);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 2);
	assert_int_equal(db_mqtt_store_read_stats(store).messages, MESSAGES);
}

static void test_bytes_are_bounded(void **state)
{
	struct db_mqtt_store *store = *state;
	uint8_t big[BYTES] = { 0 };

	db_mqtt_store_add(store, DB_MQTT_SHELF_NOW, "a", big, 700);
	db_mqtt_store_sent(store, DB_MQTT_SHELF_NOW, 1);
	db_mqtt_store_add(store, DB_MQTT_SHELF_NOW, "a", big, 700);
	/* Copies of what was sent go first, and are not counted. */
	db_mqtt_store_add(store, DB_MQTT_SHELF_NOW, "a", big, 700);
	assert_int_equal(db_mqtt_store_read_stats(store).messages, 2);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 0);
	assert_null(db_mqtt_store_first(store, DB_MQTT_SHELF_SENT));
	/* What never fits is dropped, and so is all that had to give way. */
	db_mqtt_store_add(store, DB_MQTT_SHELF_NOW, "a", big, BYTES);
	assert_int_equal(db_mqtt_store_read_stats(store).messages, 0);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 3);
}

static void test_a_device_that_is_not_there(void **state)
{
	struct db_mqtt_store *store = *state;

	add(store, DB_MQTT_SHELF_LATER, "dead", 1);
	add(store, DB_MQTT_SHELF_LATER, "a", 2);
	db_mqtt_store_park(store);
	expect(store, DB_MQTT_SHELF_LATER, 2, true);
	db_mqtt_store_unpark(store);
	expect(store, DB_MQTT_SHELF_LATER, 1, true);
	add(store, DB_MQTT_SHELF_NOW, "dead", 3);
	db_mqtt_store_forget(store, "dead");
	expect(store, DB_MQTT_SHELF_LATER, 2, true);
	assert_null(db_mqtt_store_first(store, DB_MQTT_SHELF_NOW));
	assert_int_equal(db_mqtt_store_read_stats(store).messages, 1);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 2);
	db_mqtt_store_drop(store, DB_MQTT_SHELF_LATER);
	assert_int_equal(db_mqtt_store_read_stats(store).dropped, 3);
	assert_int_equal(db_mqtt_store_read_stats(store).bytes, 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_store, close_store)
	const struct CMUnitTest tests[] = {
		TEST(test_a_lost_session_is_told_later),
		TEST(test_the_oldest_goes),
		TEST(test_bytes_are_bounded),
		TEST(test_a_device_that_is_not_there),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
