/* SPDX-License-Identifier: Apache-2.0 */
/* Which calls have the place that is kept free for stops, and the call that stops several drives. */
#include "control/control_private.h"

#include "drivebridge/command_table.h"
#include "fakes/registers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

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

/* --- Stop -------------------------------------------------------------------------------------- */

static struct fake_registers fake;
static struct db_control_socket control;
static struct db_audit_entry recorded; /* the last one */

static uint32_t record(void *context, const struct db_client *who,
                       const struct db_audit_entry *entry)
{
	(void)context;
	(void)who;
	recorded = *entry;
	return 0;
}

static const struct db_control_socket_ops ops = { .audit_post = record };
static const struct db_control_config config = { .act_group = (char *)"operators" };
static struct db_session *session;
static int client;

/* Three drives, and a session that may stop them. */
static int begin(void **state)
{
	static char names[][8] = { "feeder", "press", "saw" };
	const struct db_client operator= { .id = DB_CLIENT_FIRST_SESSION, .may_write = true };
	struct db_snapshot snapshot = {
		.feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE, .taken = 1 },
	};
	int ends[2];

	(void)state;
	fake_registers_init(&fake, 2, 3);
	for (size_t i = 0; i < 3; i++) {
		fake.drives[i].name = names[i];
		db_axis_publish(fake.axes[i], &snapshot);
	}
	fake_registers_open(&fake);
	memset(&control, 0, sizeof(control));
	memset(&recorded, 0, sizeof(recorded));
	control.setup.registers = fake.registers;
	control.setup.ops = &ops;
	control.config = &config;
	assert_int_equal(sd_event_new(&control.setup.loop), 0);
	control.epoll = epoll_create1(EPOLL_CLOEXEC);
	assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
	client = ends[1];
	session = db_session_new(&control, ends[0], &operator, DB_NS_PER_S);
	assert_non_null(session);
	return 0;
}

static int end(void **state)
{
	(void)state;
	db_session_free(session);
	sd_event_unref(control.setup.loop);
	close(client);
	close(control.epoll);
	fake_registers_close(&fake);
	return 0;
}

static void call_stop(const char *parameters)
{
	const struct db_call call = { .session = session,
		                      .parameters = json_loads(parameters, 0, NULL) };

	assert_non_null(call.parameters);
	db_stops_call(&call);
	json_decref(call.parameters);
}

/* True if these words are in the answers, which are taken away. */
static bool was_told(const char *words)
{
	bool told = session->out && strstr(session->out, words);

	free(session->out);
	session->out = NULL;
	session->out_used = session->out_sent = 0;
	return told;
}

static void it_stops_all_and_is_answered_when_all_have_ended(void **state)
{
	uint32_t first;

	(void)state;
	call_stop("{\"drives\": []}");
	assert_int_equal(fake.submitted, 3);
	for (unsigned i = 0; i < 3; i++) {
		assert_int_equal(fake.requests[i].command, DB_CMD_STOP);
		assert_int_equal(fake.requests[i].drive, i);
	}
	first = session->sequence - 2;
	db_stops_ended(session, first + 1, DB_RESULT_OK);
	db_stops_ended(session, first, DB_RESULT_TIMEOUT);
	/* An end that was told already, and one of something else. */
	db_stops_ended(session, first, DB_RESULT_OK);
	db_stops_ended(session, first + 7, DB_RESULT_OK);
	assert_null(session->out);
	db_stops_ended(session, first + 2, DB_RESULT_OK);
	assert_non_null(session->out);
	assert_non_null(strstr(session->out, "\"feeder\",\"result\":\"timeout\""));
	assert_non_null(strstr(session->out, "\"press\",\"result\":\"ok\""));
	assert_true(was_told("\"saw\",\"result\":\"ok\""));
}

/* A name that nobody has holds no other stop up. */
static void it_stops_those_that_are_named(void **state)
{
	(void)state;
	call_stop("{\"drives\": [\"saw\", \"lathe\"], \"command\": \"quick_stop\"}");
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].command, DB_CMD_QUICK_STOP);
	assert_int_equal(fake.requests[0].drive, 2);
	assert_null(session->out);
	db_stops_ended(session, session->sequence, DB_RESULT_OK);
	assert_non_null(session->out);
	assert_non_null(strstr(session->out, "\"saw\",\"result\":\"ok\""));
	assert_true(was_told("\"lathe\",\"result\":\"no_such_drive\""));
	call_stop("{\"drives\": [\"lathe\"]}");
	assert_true(was_told("no_such_drive"));
	assert_int_equal(fake.submitted, 1);
}

/* Who wants to know of each is told of each. */
static void with_more_each_end_is_told(void **state)
{
	uint32_t first;

	(void)state;
	session->more = true;
	call_stop("{\"drives\": [\"feeder\", \"press\"]}");
	first = session->sequence - 1;
	assert_null(session->out);
	db_stops_ended(session, first + 1, DB_RESULT_OK);
	assert_true(was_told("\"press\""));
	db_stops_ended(session, first, DB_RESULT_OK);
	assert_non_null(session->out);
	assert_null(strstr(session->out, "\"press\""));
	assert_true(was_told("\"feeder\""));
}

/* What goes on when its time is over is told as that. */
static void what_goes_on_is_pending(void **state)
{
	(void)state;
	call_stop("{\"drives\": [], \"wait_ms\": 100}");
	assert_true(session->due - db_control_now(&control) <= 100 * DB_NS_PER_MS);
	db_stops_ended(session, session->sequence, DB_RESULT_OK);
	db_stops_leave(session);
	assert_non_null(session->out);
	assert_non_null(strstr(session->out, "\"feeder\",\"result\":\"pending\""));
	assert_non_null(strstr(session->out, "\"press\",\"result\":\"pending\""));
	assert_true(was_told("\"saw\",\"result\":\"ok\""));
}

static void what_is_no_stop_stops_nothing(void **state)
{
	static const struct {
		const char *parameters;
		const char *wrong;
	} cases[] = {
		{ "{\"drives\": [], \"command\": \"enable\"}", "command" },
		{ "{\"drives\": [], \"command\": 3}", "command" },
		{ "{\"drives\": \"saw\"}", "drives" },
		{ "{\"drives\": [3]}", "drives" },
		{ "{\"drives\": [], \"wait_ms\": -1}", "wait_ms" },
		{ "{\"drives\": [], \"wait_ms\": 60001}", "wait_ms" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		call_stop(cases[i].parameters);
		assert_true(was_told(cases[i].wrong));
	}
	session->client.may_write = false;
	call_stop("{\"drives\": []}");
	assert_true(was_told("NotAllowed"));
	assert_int_equal(recorded.kind, DB_AUDIT_DENIED);
	assert_int_equal(fake.submitted, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_stop_has_a_place_and_no_other_command),
		cmocka_unit_test(what_is_no_command_has_no_place),
		cmocka_unit_test(a_stop_of_a_group_has_a_place),
		cmocka_unit_test(stop_and_introduce_have_a_place_other_calls_have_none),
		cmocka_unit_test_setup_teardown(it_stops_all_and_is_answered_when_all_have_ended,
		                                begin, end),
		cmocka_unit_test_setup_teardown(it_stops_those_that_are_named, begin, end),
		cmocka_unit_test_setup_teardown(with_more_each_end_is_told, begin, end),
		cmocka_unit_test_setup_teardown(what_goes_on_is_pending, begin, end),
		cmocka_unit_test_setup_teardown(what_is_no_stop_stops_nothing, begin, end),
	};

	return cmocka_run_group_tests_name("control: places for stops", tests, NULL, NULL);
}
