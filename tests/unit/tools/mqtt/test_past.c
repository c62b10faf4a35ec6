/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/past.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

static int open_past(void **state)
{
	static struct db_mqtt_past past;

	past = (struct db_mqtt_past){ .places = { { .key = 0 } } };
	*state = &past;
	return 0;
}

static void a_key_is_of_drive_user_and_id(void **state)
{
	uint64_t key = db_mqtt_past_key("lift", "anna", "1");

	(void)state;
	assert_true(key == db_mqtt_past_key("lift", "anna", "1") && key != 0);
	assert_true(key != db_mqtt_past_key("lift", "anna", "2"));
	assert_true(key != db_mqtt_past_key("lift", "otto", "1"));
	assert_true(key != db_mqtt_past_key("door", "anna", "1"));
	assert_true(db_mqtt_past_key("lift", "", "a1") != db_mqtt_past_key("lift", "a", "1"));
}

static void what_the_run_of_before_got_is_known(void **state)
{
	struct db_mqtt_past *past = *state;

	db_mqtt_past_note(past, 7, 0);
	/* This run knows it itself. */
	assert_false(db_mqtt_past_had(past, 7, 1));
	db_mqtt_past_end_run(past);
	assert_true(db_mqtt_past_had(past, 7, 1));
	assert_false(db_mqtt_past_had(past, 8, 1));
	assert_false(db_mqtt_past_had(past, 0x100000007, 1));
	db_mqtt_past_note(past, 8, 2);
	assert_false(db_mqtt_past_had(past, 8, 2));
	db_mqtt_past_end_run(past);
	assert_true(db_mqtt_past_had(past, 7, 3) && db_mqtt_past_had(past, 8, 3));
}

static void it_is_forgotten_when_nobody_repeats_it(void **state)
{
	struct db_mqtt_past *past = *state;
	db_time now = DB_MQTT_PAST_LASTS;

	db_mqtt_past_note(past, 7, 0);
	db_mqtt_past_end_run(past);
	assert_true(db_mqtt_past_had(past, 7, now));
	now += DB_MQTT_PAST_LASTS;
	assert_true(db_mqtt_past_had(past, 7, now));
	assert_false(db_mqtt_past_had(past, 7, now + DB_MQTT_PAST_LASTS + 1));
	/* And is as new. */
	db_mqtt_past_note(past, 7, now);
	assert_false(db_mqtt_past_had(past, 7, now));
}

static void the_oldest_gives_its_place(void **state)
{
	struct db_mqtt_past *past = *state;

	for (unsigned i = 0; i < DB_MQTT_PAST_PLACES; i++)
		db_mqtt_past_note(past, 1 + i, 10 + i);
	db_mqtt_past_note(past, 1, 20000);
	db_mqtt_past_note(past, 100000, 20001);
	db_mqtt_past_end_run(past);
	assert_false(db_mqtt_past_had(past, 2, 20002));
	for (unsigned i = 0; i < DB_MQTT_PAST_PLACES; i++)
		assert_true(i == 1 || db_mqtt_past_had(past, 1 + i, 20002));
	assert_true(db_mqtt_past_had(past, 100000, 20002));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_key_is_of_drive_user_and_id),
		cmocka_unit_test_setup(what_the_run_of_before_got_is_known, open_past),
		cmocka_unit_test_setup(it_is_forgotten_when_nobody_repeats_it, open_past),
		cmocka_unit_test_setup(the_oldest_gives_its_place, open_past),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
