/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/trouble.h"

#include "drivebridge/command.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define GOOD (DB_STATUS_ONLINE | DB_STATUS_BUS_UP)

static enum db_trouble_cause judge(uint32_t status, uint16_t error, struct db_trouble_signs signs)
{
	const struct db_feedback feedback = { .status = status, .error = error };

	return db_trouble_of(&feedback, &signs);
}

static void a_drive_that_answers_and_has_nothing_is_well(void **state)
{
	(void)state;
	assert_int_equal(judge(GOOD, DB_ERROR_NONE, (struct db_trouble_signs){ 0 }),
	                 DB_TROUBLE_NONE);
	assert_int_equal(db_trouble_need(DB_TROUBLE_NONE), DB_NEED_NOTHING);
}

static void without_its_bus_nothing_else_is_known_of_a_drive(void **state)
{
	const struct db_trouble_signs signs = { .silence = DB_TROUBLE_LATE, .latched = true };
	const struct db_trouble_signs aside = { .silence = DB_TROUBLE_LATE, .aside = true };

	(void)state;
	assert_int_equal(judge(0, DB_ERROR_BUS_DOWN, signs), DB_TROUBLE_PORT);
	assert_int_equal(judge(0, DB_ERROR_BUS_DOWN, aside), DB_TROUBLE_ASIDE);
}

static void a_silent_drive_has_the_cause_that_was_seen(void **state)
{
	static const enum db_trouble_cause causes[] = {
		DB_TROUBLE_NO_ANSWER,
		DB_TROUBLE_NOT_UNDERSTOOD,
		DB_TROUBLE_LATE,
		DB_TROUBLE_DEAF,
	};

	(void)state;
	for (size_t i = 0; i < sizeof causes / sizeof causes[0]; i++)
		assert_int_equal(
			judge(DB_STATUS_BUS_UP, DB_ERROR_NO_ANSWER,
		              (struct db_trouble_signs){ .silence = causes[i], .latched = true }),
			causes[i]);
	assert_int_equal(
		judge(DB_STATUS_BUS_UP, DB_ERROR_NO_ANSWER, (struct db_trouble_signs){ 0 }),
		DB_TROUBLE_NO_ANSWER);
}

/* Each with everything that is less than it. */
static void the_worst_comes_first(void **state)
{
	uint32_t status = GOOD | DB_STATUS_PARAMS_UNSAVED;
	struct db_trouble_signs signs = { 0 };

	(void)state;
	assert_int_equal(judge(status, DB_ERROR_NONE, signs), DB_TROUBLE_PARAMS_UNSAVED);
	status |= DB_STATUS_ORIGIN_LOST;
	assert_int_equal(judge(status, DB_ERROR_NONE, signs), DB_TROUBLE_ORIGIN_LOST);
	assert_int_equal(
		db_trouble_of(&(struct db_feedback){ .status = status, .doubt = DB_DOUBT_SIGN },
	                      &signs),
		DB_TROUBLE_MAY_HAVE_RESTARTED);
	status |= DB_STATUS_WARNING;
	assert_int_equal(judge(status, DB_ERROR_NONE, signs), DB_TROUBLE_WARNING);
	signs.latched = true;
	assert_int_equal(judge(status, DB_ERROR_CLIENT_LOSS, signs), DB_TROUBLE_WATCHDOG);
	assert_int_equal(judge(status, DB_ERROR_VOLTAGE, signs), DB_TROUBLE_FAULT);
	signs.two_drives = true;
	assert_int_equal(judge(status, DB_ERROR_VOLTAGE, signs), DB_TROUBLE_TWO_DRIVES);
	signs.stands_late = true;
	assert_int_equal(judge(status, DB_ERROR_VOLTAGE, signs), DB_TROUBLE_MUST_STAND);
	assert_int_equal(judge(status, DB_ERROR_RUNS_ON, signs), DB_TROUBLE_RUNS_ON);
}

static void every_cause_has_a_name_and_says_what_to_do(void **state)
{
	const struct db_trouble_about about = { .drive = "feeder",
		                                .bus = "press",
		                                .address = 7,
		                                .error = DB_ERROR_VOLTAGE,
		                                .port_advice = "; is it plugged in?",
		                                .late_ms = 40 };
	char text[DB_TROUBLE_ADVICE_MAX];

	(void)state;
	for (unsigned cause = 1; cause < DB_TROUBLE_COUNT; cause++) {
		db_trouble_advice((enum db_trouble_cause)cause, &about, text);
		assert_true(strlen(text) > 20);
		assert_null(strpbrk(text, "{}"));
		assert_string_not_equal(db_trouble_name(cause), "unknown");
		assert_true(db_trouble_need((enum db_trouble_cause)cause) > DB_NEED_NOTHING);
		for (unsigned other = 0; other < cause; other++)
			assert_string_not_equal(db_trouble_name(cause), db_trouble_name(other));
	}
	assert_string_equal(db_trouble_name(DB_TROUBLE_COUNT), "unknown");
}

static void advice_names_what_it_is_about(void **state)
{
	struct db_trouble_about about = { .drive = "feeder", .bus = "press", .address = 7 };
	char text[DB_TROUBLE_ADVICE_MAX];
	char port[DB_TROUBLE_ADVICE_MAX];

	(void)state;
	about.error = DB_ERROR_VOLTAGE;
	db_trouble_advice(DB_TROUBLE_FAULT, &about, text);
	assert_string_equal(text, "check the drive's power supply; then drivebridgectl run feeder "
	                          "clear_fault");
	db_trouble_advice(DB_TROUBLE_PORT, &about, text);
	assert_string_equal(text,
	                    "the port of bus press is not open: check the adapter and its cable");
	db_trouble_port_advice(true, EACCES, NULL, NULL, port);
	about.port_advice = port;
	db_trouble_advice(DB_TROUBLE_PORT, &about, text);
	assert_string_equal(
		text, "the port of bus press is not open; may this user open it (group dialout)?");
	db_trouble_port_advice(true, EACCES, "/dev/ttyS1", "", port);
	db_trouble_advice(DB_TROUBLE_PORT, &about, text);
	assert_string_equal(
		text, "the port of bus press is not open; may this user open it (group dialout)?");
	db_trouble_port_advice(true, EBUSY, "/dev/ttyS1", "minicom (process 7)", port);
	db_trouble_advice(DB_TROUBLE_PORT, &about, text);
	assert_string_equal(
		text, "the port of bus press is not open; minicom (process 7) has it: end that");
	db_trouble_port_advice(true, EBUSY, "/dev/ttyS1", "", port);
	db_trouble_advice(DB_TROUBLE_PORT, &about, text);
	assert_string_equal(
		text, "the port of bus press is not open; another program has it: sudo fuser -v "
		      "/dev/ttyS1 says which");
	db_trouble_advice(DB_TROUBLE_ASIDE, &about, text);
	assert_string_equal(
		text, "bus press is out of service for a scan; it comes back when that has ended");
	about.scan = "control, user anna";
	db_trouble_advice(DB_TROUBLE_ASIDE, &about, text);
	assert_string_equal(
		text,
		"bus press is out of service for a scan of control, user anna; it comes back when "
		"that has ended");
	db_trouble_advice(DB_TROUBLE_NOT_UNDERSTOOD, &about, text);
	assert_non_null(strstr(text, "another drive has address 7"));
	assert_string_equal(db_trouble_fault_advice(NULL, 5), "see the drive's manual");
	assert_string_equal(db_trouble_fault_advice(NULL, DB_ERROR_UNEXPLAINED_FAULT + 1),
	                    "see the drive's manual");
	assert_string_equal(db_trouble_fault_advice(NULL, UINT16_MAX), "see the drive's manual");
	about.late_ms = 40;
	db_trouble_advice(DB_TROUBLE_LATE, &about, text);
	assert_non_null(strstr(text, "drive-latency-ms of bus press to 60"));
	about.late_ms = 1;
	db_trouble_advice(DB_TROUBLE_LATE, &about, text);
	assert_non_null(strstr(text, "press to 1"));
	about.late_ms = 0;
	db_trouble_advice(DB_TROUBLE_LATE, &about, text);
	assert_null(strstr(text, "press to"));
}

static void a_long_name_is_cut_and_harms_nothing(void **state)
{
	char name[600];
	struct db_trouble_about about = { .drive = name, .bus = name };
	char text[DB_TROUBLE_ADVICE_MAX];

	(void)state;
	memset(name, 'x', sizeof name - 1);
	name[sizeof name - 1] = '\0';
	for (unsigned cause = 0; cause <= DB_TROUBLE_COUNT; cause++) {
		/* Wherever in the text it ends. */
		for (const char *rest = name; *rest; rest++) {
			about.drive = about.bus = rest;
			db_trouble_advice((enum db_trouble_cause)cause, &about, text);
			assert_true(strlen(text) < DB_TROUBLE_ADVICE_MAX);
		}
	}
}

static void a_stop_of_every_day_is_no_trouble(void **state)
{
	struct db_must_stand must_stand = { .cause = DB_STAND_CLIENT, .since = DB_NS_PER_S };

	(void)state;
	assert_false(db_trouble_stands_late(&must_stand, 2 * DB_NS_PER_S));
	assert_true(db_trouble_stands_late(&must_stand, 2 * DB_NS_PER_S + 1));
	must_stand.cause = DB_STAND_FREE;
	assert_false(db_trouble_stands_late(&must_stand, 9 * DB_NS_PER_S));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_answers_and_has_nothing_is_well),
		cmocka_unit_test(without_its_bus_nothing_else_is_known_of_a_drive),
		cmocka_unit_test(a_silent_drive_has_the_cause_that_was_seen),
		cmocka_unit_test(the_worst_comes_first),
		cmocka_unit_test(every_cause_has_a_name_and_says_what_to_do),
		cmocka_unit_test(advice_names_what_it_is_about),
		cmocka_unit_test(a_long_name_is_cut_and_harms_nothing),
		cmocka_unit_test(a_stop_of_every_day_is_no_trouble),
	};

	return cmocka_run_group_tests_name("trouble", tests, NULL, NULL);
}
