/* SPDX-License-Identifier: Apache-2.0 */
/* A session whose client does not take its answers, in made-up time. */
#include "control/session.h"

#include "control/control_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#define SECOND DB_NS_PER_S

static struct db_control_socket control;
static struct db_session *session;
static int client;

static int begin(void **state)
{
	const struct db_client nobody = { .id = DB_CLIENT_FIRST_SESSION };
	int ends[2];

	(void)state;
	control.epoll = epoll_create1(EPOLL_CLOEXEC);
	assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
	client = ends[1];
	session = db_session_new(&control, ends[0], &nobody, SECOND);
	return session ? 0 : -1;
}

static int end(void **state)
{
	(void)state;
	db_session_free(session);
	close(client);
	close(control.epoll);
	return 0;
}

/* An answer of many bytes, as the loop sends it. */
static void answer(size_t bytes, db_time now)
{
	char *text = malloc(bytes + 1);

	assert_non_null(text);
	memset(text, 'x', bytes);
	text[bytes] = '\0';
	db_session_reply(session, json_pack("{s:s}", "text", text), false);
	free(text);
	assert_non_null(session->out);
	session->out_since = now;
	assert_true(db_session_send(session, now));
}

/* How much the client takes. */
static size_t take(size_t most)
{
	char bytes[65536];
	size_t taken = 0;

	while (taken < most) {
		ssize_t got = recv(client, bytes,
		                   most - taken < sizeof bytes ? most - taken : sizeof bytes, 0);

		if (got <= 0)
			break;
		taken += (size_t)got;
	}
	return taken;
}

static void who_takes_its_answer_is_never_stuck(void **state)
{
	(void)state;
	assert_true(db_session_stuck_at(session) == DB_TIME_NEVER);
	answer(100, SECOND);
	assert_null(session->out);
	assert_true(db_session_stuck_at(session) == DB_TIME_NEVER);
}

static void who_takes_nothing_is_stuck_after_ten_seconds(void **state)
{
	(void)state;
	answer(4000000, 5 * SECOND);
	assert_non_null(session->out);
	assert_true(db_session_stuck_at(session) == 15 * SECOND);
	/* That the loop tries again does not count, what the client takes does. */
	assert_true(db_session_send(session, 9 * SECOND));
	assert_true(db_session_stuck_at(session) == 15 * SECOND);
	assert_true(take(200000) == 200000);
	assert_true(db_session_send(session, 12 * SECOND));
	assert_true(db_session_stuck_at(session) == 22 * SECOND);
	while (session->out) {
		assert_true(take(SIZE_MAX) > 0);
		assert_true(db_session_send(session, 13 * SECOND));
	}
	assert_true(db_session_stuck_at(session) == DB_TIME_NEVER);
}

/* The client sends bytes, which are received `now`. */
static void hear(const char *bytes, size_t count, db_time now)
{
	assert_int_equal(send(client, bytes, count, 0), count);
	assert_true(db_session_receive(session, now));
}

static void half_a_message_is_waited_for_ten_seconds(void **state)
{
	(void)state;
	assert_true(db_session_owes_until(session, SECOND) == DB_TIME_NEVER);
	hear("{", 1, 5 * SECOND);
	assert_true(db_session_owes_until(session, 5 * SECOND) == 15 * SECOND);
	/* More of it is not the rest of it. */
	hear("x", 1, 9 * SECOND);
	assert_true(db_session_owes_until(session, 9 * SECOND) == 15 * SECOND);
	hear("}\0{", 3, 12 * SECOND);
	assert_true(db_session_owes_until(session, 12 * SECOND) == DB_TIME_NEVER);
	db_session_drop_message(session, 3);
	assert_true(db_session_owes_until(session, 13 * SECOND) == 23 * SECOND);
	hear("}\0", 2, 14 * SECOND);
	db_session_drop_message(session, 2);
	assert_true(db_session_owes_until(session, 14 * SECOND) == DB_TIME_NEVER);
}

static void a_place_for_a_stop_is_kept_for_a_moment(void **state)
{
	(void)state;
	session->stops_only = true;
	assert_true(db_session_owes_until(session, 5 * SECOND) == 5 * SECOND + DB_SESSION_STOPLESS);
	hear("{", 1, 5 * SECOND);
	assert_true(db_session_owes_until(session, 5 * SECOND) == 5 * SECOND + DB_SESSION_STOPLESS);
	hear("}\0", 2, 5 * SECOND);
	assert_true(db_session_owes_until(session, 5 * SECOND) == DB_TIME_NEVER);
	db_session_drop_message(session, 2);
	/* Its stop is under way. */
	session->wait = DB_WAITS_FOR_RUN;
	assert_true(db_session_owes_until(session, 8 * SECOND) == DB_TIME_NEVER);
	session->wait = DB_WAITS_FOR_NOTHING;
	assert_true(db_session_owes_until(session, 9 * SECOND) == 9 * SECOND + DB_SESSION_STOPLESS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(who_takes_its_answer_is_never_stuck, begin, end),
		cmocka_unit_test_setup_teardown(who_takes_nothing_is_stuck_after_ten_seconds, begin,
		                                end),
		cmocka_unit_test_setup_teardown(half_a_message_is_waited_for_ten_seconds, begin,
		                                end),
		cmocka_unit_test_setup_teardown(a_place_for_a_stop_is_kept_for_a_moment, begin,
		                                end),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
