/* SPDX-License-Identifier: Apache-2.0 */
/* Alarms: coming, going, acknowledging, and their file. */
#include "health/health_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MINUTE (UINT64_C(60) * 1000000)

static void see(struct db_alarms *alarms, const char *name, enum db_trouble_cause cause,
                uint64_t since)
{
	db_alarms_see(alarms, &(struct db_alarm_seen){ .kind = DB_ALARM_DRIVE,
	                                               .cause = (uint8_t)cause,
	                                               .name = name,
	                                               .detail = "",
	                                               .since_us = since });
}

static const struct db_alarm *acknowledge(struct db_alarms *alarms, uint64_t id, uint64_t now)
{
	bool fresh;

	return db_alarms_acknowledge(alarms, id, "", "control, user anna", now, &fresh);
}

static void an_alarm_from_its_coming_to_its_end(void **state)
{
	struct db_alarms alarms = { 0 };
	const struct db_alarm *alarm;
	bool fresh;

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		see(&alarms, "feeder", DB_TROUBLE_NO_ANSWER, 5);
		db_alarms_end(&alarms, 10 + i);
	}
	assert_int_equal(alarms.count, 1);
	alarm = &alarms.list[0];
	assert_true(alarm->id == 1 && alarm->since == 5 && alarm->gone == 0 && alarm->times == 1);
	assert_true(alarms.changed && alarms.urgent);
	alarms.changed = alarms.urgent = false;
	db_alarms_end(&alarms, 20);
	assert_true(alarm->gone == 20 && alarms.changed && !alarms.urgent);
	assert_ptr_equal(acknowledge(&alarms, 1, 30), alarm);
	assert_true(alarm->acknowledged == 30 && alarms.urgent);
	/* The first one counts. */
	assert_non_null(db_alarms_acknowledge(&alarms, 1, "", "somebody else", 40, &fresh));
	assert_false(fresh);
	assert_string_equal(alarm->by, "control, user anna");
	assert_null(acknowledge(&alarms, 2, 50));
	db_alarms_clear(&alarms);
}

static void who_names_a_drive_acknowledges_no_alarm_of_another(void **state)
{
	struct db_alarms alarms = { 0 };
	bool fresh;

	(void)state;
	see(&alarms, "feeder", DB_TROUBLE_NO_ANSWER, 5);
	db_alarms_see(&alarms, &(struct db_alarm_seen){ .kind = DB_ALARM_BUS,
	                                                .cause = DB_TROUBLE_PORT,
	                                                .name = "feeder",
	                                                .detail = "" });
	assert_null(db_alarms_acknowledge(&alarms, 1, "turner", "anna", 30, &fresh));
	assert_null(db_alarms_acknowledge(&alarms, 2, "feeder", "anna", 30, &fresh));
	assert_true(alarms.list[0].acknowledged == 0 && alarms.list[1].acknowledged == 0);
	assert_non_null(db_alarms_acknowledge(&alarms, 1, "feeder", "anna", 30, &fresh));
	assert_true(fresh && alarms.list[0].acknowledged == 30);
	db_alarms_clear(&alarms);
}

static void what_comes_again_is_the_same_until_it_was_seen(void **state)
{
	struct db_alarms alarms = { 0 };
	const struct db_alarm *alarm;

	(void)state;
	/* A loose plug. */
	for (unsigned i = 0; i < 100; i++) {
		see(&alarms, "feeder", DB_TROUBLE_NO_ANSWER, 10 * MINUTE * i + 1);
		db_alarms_end(&alarms, 10 * MINUTE * i + 2);
		db_alarms_end(&alarms, 10 * MINUTE * i + 3);
	}
	assert_int_equal(alarms.count, 1);
	alarm = &alarms.list[0];
	assert_int_equal(alarm->times, 100);
	assert_true(alarm->since == 1 && alarm->came == 990 * MINUTE + 1);
	/* Soon after somebody looked it is still the same, and to be looked at again. */
	assert_non_null(acknowledge(&alarms, 1, 990 * MINUTE + 4));
	see(&alarms, "feeder", DB_TROUBLE_NO_ANSWER, 990 * MINUTE + 5);
	db_alarms_end(&alarms, 990 * MINUTE + 6);
	assert_true(alarm->times == 101 && alarm->acknowledged == 0 && alarm->by[0] == '\0');
	db_alarms_end(&alarms, 990 * MINUTE + 7);
	/* Later it is another one; and so is another cause, and another drive. */
	assert_non_null(acknowledge(&alarms, 1, 990 * MINUTE + 8));
	see(&alarms, "feeder", DB_TROUBLE_NO_ANSWER, 992 * MINUTE);
	see(&alarms, "feeder", DB_TROUBLE_FAULT, 992 * MINUTE);
	see(&alarms, "slide", DB_TROUBLE_FAULT, 992 * MINUTE);
	db_alarms_end(&alarms, 992 * MINUTE);
	assert_int_equal(alarms.count, 4);
	assert_int_equal(alarms.last_id, 4);
	db_alarms_clear(&alarms);
}

static void the_least_important_ones_go(void **state)
{
	struct db_alarms alarms = { 0 };
	char name[16];

	(void)state;
	for (unsigned i = 0; i < DB_ALARMS_MAX; i++) {
		snprintf(name, sizeof(name), "d%u", i);
		see(&alarms, name, DB_TROUBLE_FAULT, i + 1);
	}
	/* The first one is there, the third one was looked at. */
	see(&alarms, "d0", DB_TROUBLE_FAULT, 1);
	for (unsigned i = 1; i < DB_ALARMS_MAX; i++)
		alarms.seen[i] = false;
	db_alarms_end(&alarms, 1000);
	assert_non_null(acknowledge(&alarms, 3, 1001));
	see(&alarms, "d0", DB_TROUBLE_FAULT, 1);
	see(&alarms, "new", DB_TROUBLE_FAULT, 1002);
	assert_int_equal(alarms.count, DB_ALARMS_MAX);
	assert_null(acknowledge(&alarms, 3, 1003));
	see(&alarms, "newer", DB_TROUBLE_FAULT, 1004);
	assert_null(acknowledge(&alarms, 2, 1005));
	assert_non_null(acknowledge(&alarms, 1, 1006));
	db_alarms_end(&alarms, 1007);
	assert_int_equal(alarms.list[0].gone, 0);
	assert_int_equal(alarms.list[DB_ALARMS_MAX - 1].gone, 0);
	db_alarms_clear(&alarms);
}

static void the_file_has_everything_or_is_refused(void **state)
{
	struct db_alarms alarms = { 0 };
	struct db_alarms read = { 0 };
	char longest[400];
	uint8_t *bytes;
	size_t size;

	(void)state;
	memset(longest, 'x', sizeof(longest) - 1);
	longest[sizeof(longest) - 1] = '\0';
	memcpy(longest + DB_ALARM_DETAIL_MAX - 2, "\xC3\xA4", 2); /* a letter of two bytes */
	for (unsigned i = 0; i < 20; i++)
		db_alarms_see(&alarms, &(struct db_alarm_seen){ .kind = i % DB_ALARM_KIND_COUNT,
		                                                .cause = (uint8_t)i,
		                                                .name = "feeder",
		                                                .detail = longest,
		                                                .since_us = i });
	assert_int_equal(strlen(alarms.list[0].detail), DB_ALARM_DETAIL_MAX - 2);
	assert_non_null(acknowledge(&alarms, 7, UINT64_C(1) << 50));
	bytes = db_alarms_write(&alarms, &size);
	assert_non_null(bytes);
	assert_true(db_alarms_read(&read, bytes, size));
	assert_int_equal(read.count, 20);
	assert_memory_equal(read.list, alarms.list, 20 * sizeof(*read.list));
	assert_true(read.last_id == 20 && read.last_change == 21);
	db_alarms_clear(&read);
	for (size_t part = 0; part < size; part++) {
		assert_false(db_alarms_read(&read, bytes, part));
		bytes[part] ^= 1;
		/* Two bytes behind the version are not used. */
		assert_true(db_alarms_read(&read, bytes, size) == (part == 10 || part == 11));
		db_alarms_clear(&read);
		bytes[part] ^= 1;
	}
	free(bytes);
	db_alarms_clear(&alarms);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_alarm_from_its_coming_to_its_end),
		cmocka_unit_test(who_names_a_drive_acknowledges_no_alarm_of_another),
		cmocka_unit_test(what_comes_again_is_the_same_until_it_was_seen),
		cmocka_unit_test(the_least_important_ones_go),
		cmocka_unit_test(the_file_has_everything_or_is_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
