/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/ration.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static int open_ration(void **state)
{
	static struct db_mqtt_ration ration;

	ration = (struct db_mqtt_ration){ .places = { { .left = 0 } } };
	*state = &ration;
	return 0;
}

/* How many of so many are answered. */
static unsigned ask(struct db_mqtt_ration *ration, const char *drive, const char *sender,
                    db_time now, unsigned times)
{
	unsigned answered = 0;

	for (unsigned i = 0; i < times; i++)
		answered += db_mqtt_ration_take(ration, drive, sender, now);
	return answered;
}

static void a_sender_has_so_many_in_a_second(void **state)
{
	assert_int_equal(ask(*state, "lift", "", 0, 1000), DB_MQTT_RATION_SENDER);
	assert_int_equal(ask(*state, "lift", "", DB_NS_PER_S - 1, 1000), 0);
	assert_int_equal(ask(*state, "lift", "", DB_NS_PER_S, 1000), DB_MQTT_RATION_SENDER);
}

static void others_have_their_own(void **state)
{
	assert_int_equal(ask(*state, "lift", "otto", 0, 1000), DB_MQTT_RATION_SENDER);
	assert_int_equal(ask(*state, "lift", "anna", 0, 5), 5);
	assert_int_equal(ask(*state, "feeder", "otto", 0, 5), 5);
}

/* However many names somebody makes up. */
static void a_drive_has_so_many_in_a_second(void **state)
{
	unsigned answered = 0;
	char name[16];

	for (unsigned i = 0; i < 1000; i++) {
		(void)snprintf(name, sizeof(name), "n%u", i);
		answered += ask(*state, "lift", name, 0, 3);
	}
	assert_int_equal(answered, DB_MQTT_RATION_DRIVE);
	assert_int_equal(ask(*state, "feeder", "anna", 0, 5), 5);
}

/* More drives at once than places: none is answered without a bound. */
static void places_are_bounded(void **state)
{
	unsigned answered = 0;
	char name[16];

	for (unsigned i = 0; i < 1000; i++) {
		(void)snprintf(name, sizeof(name), "d%u", i);
		answered += ask(*state, name, "", 0, 1);
	}
	assert_int_equal(answered, DB_MQTT_RATION_PLACES / 2);
	assert_int_equal(ask(*state, "new", "", DB_NS_PER_S, 1), 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(a_sender_has_so_many_in_a_second, open_ration),
		cmocka_unit_test_setup(others_have_their_own, open_ration),
		cmocka_unit_test_setup(a_drive_has_so_many_in_a_second, open_ration),
		cmocka_unit_test_setup(places_are_bounded, open_ration),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
