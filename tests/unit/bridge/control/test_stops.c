/* SPDX-License-Identifier: Apache-2.0 */
/* Which calls have the place that is kept free for stops, whatever else is going on. */
#include "control/control_private.h"

#include "drivebridge/command_table.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define CONTROL "io.drivebridge.Control."

static bool has_place(const char *method, const char *parameters)
{
	struct db_message message;
	char text[512];
	bool has;

	snprintf(text, sizeof(text), "{\"method\": \"%s\", \"parameters\": %s}", method,
	         parameters);
	assert_null(db_message_parse(text, strlen(text), &message));
	has = db_stops_has_place(&message);
	db_message_clear(&message);
	return has;
}

static void every_stop_has_a_place_and_no_other_command(void **state)
{
	char parameters[128];

	(void)state;
	for (size_t i = 0; i < db_command_row_count; i++) {
		const struct db_command_row *row = &db_command_rows[i];
		bool stop = db_command_is_stop(row->code);

		snprintf(parameters, sizeof(parameters),
		         "{\"drive\": \"lift\", \"command\": \"%s\"}", row->name);
		assert_int_equal(has_place(CONTROL "Run", parameters), stop);
		/* In a register it may be a name or its code. */
		snprintf(parameters, sizeof(parameters),
		         "{\"drive\": \"lift\", \"values\": {\"command\": \"%s\"}}", row->name);
		assert_int_equal(has_place(CONTROL "Write", parameters), stop);
		snprintf(parameters, sizeof(parameters),
		         "{\"drive\": \"lift\", \"values\": {\"command\": %d}}", (int)row->code);
		assert_int_equal(has_place(CONTROL "Write", parameters), stop);
	}
}

static void what_is_no_command_has_no_place(void **state)
{
	static const char *const values[] = { "0",    "-1",       "64",   "1000", "2.5",
		                              "\"\"", "\"Stop\"", "null", "true", "[\"stop\"]" };
	char parameters[128];

	(void)state;
	for (size_t i = 0; i < sizeof(values) / sizeof(values[0]); i++) {
		snprintf(parameters, sizeof(parameters), "{\"drive\": \"lift\", \"command\": %s}",
		         values[i]);
		assert_false(has_place(CONTROL "Run", parameters));
		snprintf(parameters, sizeof(parameters),
		         "{\"drive\": \"lift\", \"values\": {\"command\": %s}}", values[i]);
		assert_false(has_place(CONTROL "Write", parameters));
	}
	assert_false(has_place(CONTROL "Run", "{}"));
	assert_false(has_place(CONTROL "Write", "{}"));
	assert_false(has_place(CONTROL "Write", "{\"drive\": \"lift\", \"values\": 5}"));
	assert_false(has_place(CONTROL "Write",
	                       "{\"drive\": \"lift\", \"values\": {\"target_position\": 3}}"));
}

/* At the gateway a stop of a group is one; a drive has no such register. */
static void a_stop_of_a_group_has_a_place(void **state)
{
	(void)state;
	assert_true(
		has_place(CONTROL "Write", "{\"drive\": \"\", \"values\": {\"group_stop\": 1}}"));
	assert_true(has_place(CONTROL "Write",
	                      "{\"drive\": \"\", \"values\": {\"group_stop_units\": 1}}"));
	assert_false(
		has_place(CONTROL "Write", "{\"drive\": \"\", \"values\": {\"group_start\": 1}}"));
	assert_false(has_place(CONTROL "Write",
	                       "{\"drive\": \"lift\", \"values\": {\"group_stop\": 1}}"));
}

/* For whom it stops may have to be said first. */
static void stop_and_introduce_have_a_place_other_calls_have_none(void **state)
{
	static const char *const others[] = { "Read",   "Describe", "Subscribe", "Events",
		                              "Reload", "StopScan", "Stops",     "stop",
		                              "Beat",   "Audit",    "Introduced" };
	char method[64];

	(void)state;
	assert_true(has_place(CONTROL "Stop", "{}"));
	assert_true(has_place(CONTROL "Stop", "{\"drives\": [\"lift\"]}"));
	assert_true(has_place(CONTROL "Introduce", "{}"));
	for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++) {
		snprintf(method, sizeof(method), CONTROL "%s", others[i]);
		assert_false(has_place(method, "{}"));
	}
	/* Of this interface only. */
	assert_false(has_place("org.varlink.service.Stop", "{}"));
	assert_false(has_place("Stop", "{}"));
	assert_false(has_place("io.drivebridge.Controls.Stop", "{}"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_stop_has_a_place_and_no_other_command),
		cmocka_unit_test(what_is_no_command_has_no_place),
		cmocka_unit_test(a_stop_of_a_group_has_a_place),
		cmocka_unit_test(stop_and_introduce_have_a_place_other_calls_have_none),
	};

	return cmocka_run_group_tests_name("control: places for stops", tests, NULL, NULL);
}
