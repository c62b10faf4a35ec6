/* SPDX-License-Identifier: Apache-2.0 */
/* A connection in an event loop, in front of a service that this test plays. */
#include "client/link.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

#define TURN_US 5000000 /* longer than an event of a busy machine takes */

static char folder[40];
static char path[64];
static int listener;
static int connection;
static sd_event *loop;
static struct db_link *link_of;
static unsigned lost;

/* What answers brought. */
struct heard {
	unsigned answers;
	unsigned errors;
	char name[64];
};

static void hear(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct heard *heard = data;

	(void)parameters;
	(void)more;
	heard->answers++;
	heard->errors += error != NULL;
	if (error)
		snprintf(heard->name, sizeof(heard->name), "%s", error->name);
}

static void lose(void *data)
{
	(void)data;
	lost++;
}

static int begin(void **state)
{
	struct db_client_error error = { .parameters = NULL };
	struct sockaddr_un address = { .sun_family = AF_UNIX };

	(void)state;
	lost = 0;
	strcpy(folder, "/tmp/drivebridge-link-XXXXXX");
	assert_non_null(mkdtemp(folder));
	snprintf(path, sizeof(path), "%s/control", folder);
	strcpy(address.sun_path, path);
	listener = socket(AF_UNIX, SOCK_STREAM, 0);
	assert_int_equal(bind(listener, (struct sockaddr *)&address, sizeof(address)), 0);
	assert_int_equal(listen(listener, 4), 0);
	assert_int_equal(sd_event_new(&loop), 0);
	link_of = db_link_open(loop, path, lose, NULL, &error);
	assert_non_null(link_of);
	connection = accept(listener, NULL, NULL);
	return connection >= 0 ? 0 : -1;
}

static int end(void **state)
{
	(void)state;
	db_link_close(link_of);
	link_of = NULL;
	sd_event_unref(loop);
	close(connection);
	close(listener);
	unlink(path);
	return rmdir(folder);
}

static void send_call(struct heard *heard)
{
	assert_int_equal(db_link_send(link_of, "Describe", NULL, false, hear, heard), 0);
}

static void answers_arrive_in_the_loop(void **state)
{
	static const char text[] = "{\"parameters\":{}}";
	struct heard heard = { .answers = 0 };

	(void)state;
	send_call(&heard);
	assert_int_equal(db_link_waiting(link_of), 1);
	assert_int_equal(write(connection, text, sizeof(text)), sizeof(text));
	while (heard.answers == 0)
		assert_true(sd_event_run(loop, TURN_US) > 0);
	assert_int_equal(heard.errors, 0);
	assert_int_equal(db_link_waiting(link_of), 0);
	assert_int_equal(lost, 0);
}

/* Whoever waits is told before it is closed, each once. */
static void who_waits_is_told_when_it_is_closed(void **state)
{
	struct heard first = { .answers = 0 };
	struct heard second = { .answers = 0 };

	(void)state;
	send_call(&first);
	send_call(&second);
	db_link_close(link_of);
	link_of = NULL;
	assert_int_equal(first.answers, 1);
	assert_int_equal(first.errors, 1);
	assert_string_equal(first.name, DB_CLIENT_LOST);
	assert_int_equal(second.answers, 1);
	assert_string_equal(second.name, DB_CLIENT_LOST);
	/* It is not lost: who closes it knows that. */
	assert_int_equal(lost, 0);
}

static void nobody_is_told_when_it_is_dropped(void **state)
{
	struct heard heard = { .answers = 0 };

	(void)state;
	send_call(&heard);
	db_link_drop(link_of);
	link_of = NULL;
	assert_int_equal(heard.answers, 0);
	assert_int_equal(lost, 0);
}

/* Calls are answered first, then it is told, and not again and again. */
static void a_service_that_goes_is_lost_once(void **state)
{
	struct heard heard = { .answers = 0 };

	(void)state;
	send_call(&heard);
	assert_int_equal(shutdown(connection, SHUT_RDWR), 0);
	while (lost == 0)
		assert_true(sd_event_run(loop, TURN_US) > 0);
	assert_int_equal(heard.answers, 1);
	assert_string_equal(heard.name, DB_CLIENT_LOST);
	/* Nothing else happens then. */
	for (unsigned i = 0; i < 3; i++)
		(void)sd_event_run(loop, 0);
	assert_int_equal(lost, 1);
	assert_int_equal(heard.answers, 1);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)
	const struct CMUnitTest tests[] = {
		TEST(answers_arrive_in_the_loop),
		TEST(who_waits_is_told_when_it_is_closed),
		TEST(nobody_is_told_when_it_is_dropped),
		TEST(a_service_that_goes_is_lost_once),
	};

	return cmocka_run_group_tests_name("client: a connection in a loop", tests, NULL, NULL);
}
