/* SPDX-License-Identifier: Apache-2.0 */
/* Calls that are carried out in time and once, and proofs of age with what starts a motion. */
#include "control/once.h"

#include "control/control_private.h"
#include "control/token.h"
#include "drivebridge/command_table.h"

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

#define RUN 77

static struct db_control_socket control;
static struct db_session *session;
static int client;

static int begin(void **state)
{
	const struct db_client nobody = { .id = DB_CLIENT_FIRST_SESSION };
	int ends[2];

	(void)state;
	memset(&control, 0, sizeof(control));
	control.run = RUN;
	assert_int_equal(sd_event_new(&control.setup.loop), 0);
	control.epoll = epoll_create1(EPOLL_CLOEXEC);
	assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
	client = ends[1];
	session = db_session_new(&control, ends[0], &nobody, DB_NS_PER_S);
	assert_non_null(session);
	session->client.arrived = db_control_now(&control);
	return 0;
}

static int end(void **state)
{
	(void)state;
	db_session_free(session);
	sd_event_unref(control.setup.loop);
	db_ids_clear(&control.ids);
	close(client);
	close(control.epoll);
	return 0;
}

static struct db_call call_of(json_t *parameters)
{
	return (struct db_call){ .session = session, .parameters = parameters };
}

/* True if a call with these parameters is to be begun now; else its answer waits. */
static bool may_begin(json_t *parameters, bool stops)
{
	const struct db_call call = call_of(parameters);
	bool may = db_once_begin(&call, "lift", stops);

	json_decref(parameters);
	return may;
}

/* True if this is in the answer, which is taken away. */
static bool was_told(const char *text)
{
	bool told = session->out && strstr(session->out, text);

	free(session->out);
	session->out = NULL;
	session->out_used = session->out_sent = 0;
	return told;
}

/* The loop's time, so many milliseconds earlier. */
static json_int_t us_ago(int64_t ms)
{
	return (json_int_t)(db_control_now(&control) / DB_NS_PER_US) - ms * 1000;
}

/* --- in time ---------------------------------------------------------------------------------- */

static void a_call_that_waited_too_long_is_not_begun(void **state)
{
	(void)state;
	assert_true(may_begin(json_pack("{s:i, s:I}", "within_ms", 2000, "sent_us", us_ago(1000)),
	                      false));
	assert_false(may_begin(json_pack("{s:i, s:I}", "within_ms", 900, "sent_us", us_ago(1000)),
	                       false));
	assert_true(was_told("io.drivebridge.Control.Late"));
	/* Without a limit none is checked, and a stop is never too late. */
	assert_true(may_begin(json_pack("{s:I}", "sent_us", us_ago(100000)), false));
	assert_true(
		may_begin(json_pack("{s:i, s:I}", "within_ms", 1, "sent_us", us_ago(1000)), true));
	assert_null(session->out);
}

/* From when it was read, where its caller does not say when it was sent. */
static void the_time_in_the_service_counts(void **state)
{
	(void)state;
	session->client.arrived -= 5000 * DB_NS_PER_MS;
	assert_false(may_begin(json_pack("{s:i}", "within_ms", 4000), false));
	assert_true(was_told("io.drivebridge.Control.Late"));
	assert_true(may_begin(json_pack("{s:i}", "within_ms", 6000), false));
}

/* What was too late was not begun: its id is as new. */
static void a_late_call_uses_no_id_up(void **state)
{
	(void)state;
	assert_false(may_begin(
		json_pack("{s:s, s:i, s:I}", "id", "a", "within_ms", 1, "sent_us", us_ago(1000)),
		false));
	assert_true(was_told("Late"));
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	assert_false(session->repeated);
}

/* --- once ------------------------------------------------------------------------------------- */

static void a_call_with_an_id_is_begun_once(void **state)
{
	uint64_t first;

	(void)state;
	assert_true(may_begin(json_object(), false));
	assert_int_equal(session->once, 0);
	assert_true(may_begin(json_pack("{s:n}", "id"), false));
	assert_int_equal(session->once, 0);
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	first = session->once;
	assert_int_not_equal(first, 0);
	/* The second one waits for the end of the first one. */
	assert_false(may_begin(json_pack("{s:s}", "id", "a"), false));
	assert_int_equal(session->once, first);
	assert_true(session->repeated);
	assert_int_equal(session->wait, DB_WAITS_FOR_FIRST);
	assert_null(session->out);
	session->repeated = false;
	assert_true(may_begin(json_pack("{s:s}", "id", "b"), false));
	assert_int_not_equal(session->once, first);
	/* A stop is begun as often as it is asked for. */
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), true));
	assert_int_equal(session->once, 0);
	assert_false(session->repeated);
}

/* Also to one that is too late: it was begun in time. */
static void a_repeat_is_never_too_late(void **state)
{
	(void)state;
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	assert_false(may_begin(
		json_pack("{s:s, s:i, s:I}", "id", "a", "within_ms", 1, "sent_us", us_ago(1000)),
		false));
	assert_true(session->repeated);
	assert_null(session->out);
}

static void what_was_refused_may_be_said_again(void **state)
{
	static const enum db_result refused[] = { DB_RESULT_BUSY, DB_RESULT_NOT_IN_CONTROL };

	(void)state;
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	db_once_drop(session);
	assert_int_equal(session->once, 0);
	for (size_t i = 0; i < 2; i++) {
		assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
		db_once_end(session, refused[i], true);
	}
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
}

static void a_repeat_gets_the_result_of_the_first(void **state)
{
	const struct db_id_call *first;

	(void)state;
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	db_once_end(session, DB_RESULT_OK, false);
	first = db_once_first(session);
	assert_int_equal(first->result, DB_RESULT_OK);
	assert_false(first->over);
	db_once_end(session, DB_RESULT_FAILED, true);
	assert_int_equal(first->result, DB_RESULT_FAILED);
	assert_true(first->over);
	/* What was over stays so. */
	db_once_end(session, DB_RESULT_FAILED, false);
	assert_true(first->over);
	assert_false(may_begin(json_pack("{s:s}", "id", "a"), false));
	assert_int_equal(db_once_first(session)->result, DB_RESULT_FAILED);
}

/* Nobody could wait for its end: it may have been carried out or not. */
static void an_end_that_nobody_saw_is_not_known(void **state)
{
	(void)state;
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	db_once_end(session, DB_RESULT_PENDING, false);
	assert_int_equal(db_once_first(session)->result, DB_RESULT_INDETERMINATE);
	assert_true(may_begin(json_pack("{s:s}", "id", "b"), false));
	session->wait = DB_WAITS_FOR_WRITE;
	db_once_abandon(session);
	assert_int_equal(session->once, 0);
	assert_false(may_begin(json_pack("{s:s}", "id", "b"), false));
	assert_int_equal(db_once_first(session)->result, DB_RESULT_INDETERMINATE);
	assert_true(db_once_first(session)->over);
	/* Of a command its end is still told by its token. */
	assert_true(may_begin(json_pack("{s:s}", "id", "c"), false));
	session->wait = DB_WAITS_FOR_RUN;
	db_once_abandon(session);
	assert_false(may_begin(json_pack("{s:s}", "id", "c"), false));
	assert_int_equal(db_once_first(session)->result, DB_RESULT_PENDING);
}

static void who_cannot_be_answered_does_not_wait(void **state)
{
	(void)state;
	session->oneway = true;
	assert_true(may_begin(json_pack("{s:s}", "id", "a"), false));
	assert_false(may_begin(json_pack("{s:s}", "id", "a"), false));
	assert_int_equal(session->wait, DB_WAITS_FOR_NOTHING);
	assert_null(session->out);
}

/* --- what a call may say ---------------------------------------------------------------------- */

static void wrong_parameters_are_named(void **state)
{
	char longest[DB_ID_MAX + 2];
	static const struct {
		const char *parameters;
		const char *wrong;
	} cases[] = {
		{ "{\"id\": \"\"}", "\"id\"" },
		{ "{\"id\": 5}", "\"id\"" },
		{ "{\"within_ms\": 0}", "\"within_ms\"" },
		{ "{\"within_ms\": -1}", "\"within_ms\"" },
		{ "{\"within_ms\": 120001}", "\"within_ms\"" },
		{ "{\"within_ms\": \"1\"}", "\"within_ms\"" },
		{ "{\"within_ms\": 1.5}", "\"within_ms\"" },
		{ "{\"sent_us\": -1}", "\"sent_us\"" },
		{ "{\"sent_us\": \"1\"}", "\"sent_us\"" },
		{ "{\"sent_us\": 9223372036854776}", "\"sent_us\"" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		assert_false(may_begin(json_loads(cases[i].parameters, 0, NULL), false));
		assert_true(was_told(cases[i].wrong));
	}
	memset(longest, 'x', sizeof(longest));
	longest[DB_ID_MAX + 1] = '\0';
	assert_false(may_begin(json_pack("{s:s}", "id", longest), false));
	assert_true(was_told("\"id\""));
	longest[DB_ID_MAX] = '\0';
	assert_true(may_begin(json_pack("{s:s}", "id", longest), false));
	assert_true(may_begin(json_pack("{s:i}", "within_ms", 120000), false));
	assert_true(may_begin(json_pack("{s:I}", "sent_us", (json_int_t)9223372036854775), false));
	assert_true(may_begin(json_pack("{s:n, s:n, s:n}", "id", "within_ms", "sent_us"), false));
}

/* --- proofs of age ---------------------------------------------------------------------------- */

static bool is_young(json_t *parameters)
{
	const struct db_call call = call_of(parameters);
	bool young = db_held_is_young(&call);

	json_decref(parameters);
	return young;
}

static json_t *token_of(uint32_t run, int64_t ms_old)
{
	char text[DB_TOKEN_MAX];

	db_token_write(text, run, db_control_clock() - ms_old * DB_NS_PER_MS);
	return json_pack("{s:s}", "token", text);
}

static void an_old_token_starts_nothing(void **state)
{
	(void)state;
	assert_true(is_young(token_of(RUN, 0)));
	assert_true(is_young(NULL));
	assert_false(is_young(token_of(RUN, DB_TOKEN_FRESH_MS + 1)));
	assert_true(was_told("TooOld"));
	/* Of another run, of the future, none at all: its age is not known. */
	assert_false(is_young(token_of(RUN + 1, 0)));
	assert_true(was_told("\"age_ms\":null") || session->out == NULL);
	assert_false(is_young(token_of(RUN, -60000)));
	assert_true(was_told("TooOld"));
	assert_false(is_young(json_pack("{s:s}", "token", "")));
	assert_true(was_told("TooOld"));
	assert_false(is_young(json_pack("{s:i}", "token", 5)));
	assert_true(was_told("InvalidParameter"));
}

static bool may_hold(const char *command, json_t *parameters, uint32_t *hold_ms)
{
	const struct db_call call = call_of(parameters);
	bool may = db_held_span(&call, db_command_find_name(command), hold_ms);

	json_decref(parameters);
	return may;
}

static void a_held_motion_needs_a_token_and_somebody_to_hold_it(void **state)
{
	uint32_t hold_ms = 1;

	(void)state;
	assert_true(may_hold("move_velocity", json_object(), &hold_ms));
	assert_int_equal(hold_ms, 0);
	assert_true(may_hold("move_velocity", json_pack("{s:i, s:s}", "hold_ms", 300, "token", "x"),
	                     &hold_ms));
	assert_int_equal(hold_ms, 300);
	assert_false(may_hold("move_velocity", json_pack("{s:i}", "hold_ms", 300), &hold_ms));
	assert_true(was_told("token"));
	assert_false(may_hold("enable", json_pack("{s:i, s:s}", "hold_ms", 300, "token", "x"),
	                      &hold_ms));
	assert_true(was_told("hold_ms"));
	assert_false(may_hold("move_velocity",
	                      json_pack("{s:i, s:s}", "hold_ms", DB_HOLD_MAX_MS + 1, "token", "x"),
	                      &hold_ms));
	assert_true(was_told("hold_ms"));
	/* A stop is always a stop. */
	assert_true(may_hold("stop", json_pack("{s:s}", "hold_ms", "nonsense"), &hold_ms));
	assert_int_equal(hold_ms, 0);
	/* Its beats cannot arrive. */
	session->ended = true;
	assert_false(may_hold("move_velocity",
	                      json_pack("{s:i, s:s}", "hold_ms", 300, "token", "x"), &hold_ms));
	assert_true(was_told("the connection has ended"));
	assert_true(may_hold("move_velocity", json_object(), &hold_ms));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)
	const struct CMUnitTest tests[] = {
		TEST(a_call_that_waited_too_long_is_not_begun),
		TEST(the_time_in_the_service_counts),
		TEST(a_late_call_uses_no_id_up),
		TEST(a_call_with_an_id_is_begun_once),
		TEST(a_repeat_is_never_too_late),
		TEST(what_was_refused_may_be_said_again),
		TEST(a_repeat_gets_the_result_of_the_first),
		TEST(an_end_that_nobody_saw_is_not_known),
		TEST(who_cannot_be_answered_does_not_wait),
		TEST(wrong_parameters_are_named),
		TEST(an_old_token_starts_nothing),
		TEST(a_held_motion_needs_a_token_and_somebody_to_hold_it),
	};

	return cmocka_run_group_tests_name("control: in time and once", tests, NULL, NULL);
}
