/* SPDX-License-Identifier: Apache-2.0 */
/* The client in front of a service that this test plays, well and badly. */
#include "client/client.h"

#include <errno.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

struct fake {
	char folder[64];
	char path[96];
	int listener;
	int connection;
	struct db_client *client;
	struct db_client_error error;
};

/* What an answer brought. */
struct heard {
	unsigned answers;
	unsigned errors;
	bool more;
	char name[96];
	char text[512];
	json_int_t number;
};

static void hear(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct heard *heard = data;

	heard->answers++;
	heard->more = more;
	heard->number = json_integer_value(json_object_get(parameters, "number"));
	if (!error)
		return;
	assert_null(parameters);
	heard->errors++;
	(void)snprintf(heard->name, sizeof(heard->name), "%s", error->name);
	(void)snprintf(heard->text, sizeof(heard->text), "%s", error->text);
}

static void bind_path(int fd, const char *path)
{
	struct sockaddr_un address = { .sun_family = AF_UNIX };

	memcpy(address.sun_path, path, strlen(path));
	assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof(address)), 0);
}

static int open_fake(void **state)
{
	struct fake *fake = calloc(1, sizeof(*fake));

	assert_non_null(fake);
	(void)snprintf(fake->folder, sizeof(fake->folder), "/tmp/drivebridge-client-XXXXXX");
	assert_non_null(mkdtemp(fake->folder));
	(void)snprintf(fake->path, sizeof(fake->path), "%s/control", fake->folder);
	fake->listener = socket(AF_UNIX, SOCK_STREAM, 0);
	bind_path(fake->listener, fake->path);
	assert_int_equal(listen(fake->listener, 4), 0);
	assert_int_equal(db_client_open(fake->path, &fake->client, &fake->error), 0);
	fake->connection = accept(fake->listener, NULL, NULL);
	assert_true(fake->connection >= 0);
	*state = fake;
	return 0;
}

static int close_fake(void **state)
{
	struct fake *fake = *state;

	db_client_close(fake->client);
	db_client_error_clear(&fake->error);
	if (fake->connection >= 0)
		(void)close(fake->connection);
	(void)close(fake->listener);
	(void)unlink(fake->path);
	(void)rmdir(fake->folder);
	free(fake);
	return 0;
}

/* With its zero byte. */
static void answer(struct fake *fake, const char *text)
{
	assert_int_equal(write(fake->connection, text, strlen(text) + 1), strlen(text) + 1);
}

static void expect_call(struct fake *fake, const char *text)
{
	char bytes[512];

	assert_int_equal(read(fake->connection, bytes, sizeof(bytes)), strlen(text) + 1);
	assert_string_equal(bytes, text);
}

static void test_a_call_is_answered(void **state)
{
	struct fake *fake = *state;
	json_t *got = NULL;

	answer(fake, "{\"parameters\":{\"number\":7}}");
	assert_int_equal(db_client_call(fake->client, "Describe", NULL, 1000, &got, &fake->error),
	                 0);
	assert_int_equal(json_integer_value(json_object_get(got, "number")), 7);
	json_decref(got);
	expect_call(fake, "{\"method\":\"io.drivebridge.Control.Describe\"}");
	/* An answer may have no parameters. */
	answer(fake, "{}");
	assert_int_equal(db_client_call(fake->client, "org.varlink.service.GetInfo", NULL, 1000,
	                                &got, &fake->error),
	                 0);
	assert_int_equal(json_object_size(got), 0);
	json_decref(got);
	expect_call(fake, "{\"method\":\"org.varlink.service.GetInfo\"}");
}

static void test_answers_come_in_the_order_of_calls(void **state)
{
	struct fake *fake = *state;
	struct heard one = { .answers = 0 };
	struct heard two = { .answers = 0 };

	assert_int_equal(db_client_send(fake->client, "A", NULL, false, hear, &one), 0);
	assert_int_equal(db_client_send(fake->client, "B", NULL, false, hear, &two), 0);
	assert_int_equal(db_client_waiting(fake->client), 2);
	answer(fake, "{\"parameters\":{\"number\":1}}");
	assert_int_equal(db_client_handle(fake->client), 0);
	assert_int_equal(one.number, 1);
	assert_int_equal(two.answers, 0);
	answer(fake, "{\"parameters\":{\"number\":2}}");
	assert_int_equal(db_client_handle(fake->client), 0);
	assert_int_equal(two.number, 2);
	assert_int_equal(db_client_waiting(fake->client), 0);
}

static void test_a_stream_goes_on_until_it_ends(void **state)
{
	struct fake *fake = *state;
	struct heard heard = { .answers = 0 };

	assert_int_equal(db_client_send(fake->client, "Subscribe", NULL, true, hear, &heard), 0);
	expect_call(fake, "{\"method\":\"io.drivebridge.Control.Subscribe\",\"more\":true}");
	answer(fake, "{\"parameters\":{\"number\":1},\"continues\":true}");
	answer(fake, "{\"parameters\":{\"number\":2},\"continues\":true}");
	assert_int_equal(db_client_handle(fake->client), 0);
	assert_int_equal(heard.answers, 2);
	assert_true(heard.more);
	answer(fake, "{\"parameters\":{\"number\":3}}");
	assert_int_equal(db_client_handle(fake->client), 0);
	assert_false(heard.more);
	assert_int_equal(heard.number, 3);
	assert_int_equal(db_client_waiting(fake->client), 0);
}

static void test_errors_have_names_parameters_and_words(void **state)
{
	static const char *const cases[][2] = {
		{ "{\"error\":\"io.drivebridge.Control.NoSuchDrive\",\"parameters\":{\"drive\":\"fedr\"}}",
		  "no drive is called \"fedr\"" },
		{ "{\"error\":\"io.drivebridge.Control.Refused\",\"parameters\":{\"result\":\"limit\","
		  "\"code\":9,\"reason\":\"beyond max-position\"}}",
		  "limit: beyond max-position" },
		{ "{\"error\":\"io.drivebridge.Control.Busy\"}",
		  "the service has too much to do at once; try again" },
		/* What is not as the interface has it. */
		{ "{\"error\":\"io.drivebridge.Control.NoSuchDrive\",\"parameters\":{\"drive\":3}}",
		  "no drive is called \"?\"" },
		{ "{\"error\":\"a.b.Unheard\"}", "the service answers a.b.Unheard" },
	};
	struct fake *fake = *state;
	json_t *got = NULL;

	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		answer(fake, cases[i][0]);
		assert_int_equal(
			db_client_call(fake->client, "Run", NULL, 1000, &got, &fake->error), -1);
		assert_null(got);
		assert_string_equal(fake->error.text, cases[i][1]);
	}
	answer(fake, cases[1][0]);
	assert_int_equal(db_client_call(fake->client, "Run", NULL, 1000, &got, &fake->error), -1);
	assert_string_equal(fake->error.name, "io.drivebridge.Control.Refused");
	assert_int_equal(json_integer_value(json_object_get(fake->error.parameters, "code")), 9);
}

/* Who has sent several calls before the service said that it has no room for the session hears that of each of them; a
 * connection that is lost later is lost. */
static void test_no_room_for_a_session_is_told_to_all_calls(void **state)
{
	struct fake *fake = *state;
	struct heard first = { .answers = 0 };
	struct heard second = { .answers = 0 };

	assert_int_equal(db_client_send(fake->client, "Introduce", NULL, false, hear, &first), 0);
	assert_int_equal(db_client_send(fake->client, "Run", NULL, false, hear, &second), 0);
	answer(fake, "{\"error\":\"io.drivebridge.Control.Busy\"}");
	(void)shutdown(fake->connection, SHUT_RDWR);
	assert_int_equal(db_client_handle(fake->client), -1);
	assert_string_equal(first.name, "io.drivebridge.Control.Busy");
	assert_string_equal(second.name, "io.drivebridge.Control.Busy");
}

static void test_busy_is_no_reason_for_a_later_loss(void **state)
{
	struct fake *fake = *state;
	struct heard heard[3] = { { .answers = 0 } };

	for (size_t i = 0; i < 3; i++)
		assert_int_equal(db_client_send(fake->client, "Run", NULL, false, hear, &heard[i]),
		                 0);
	answer(fake, "{\"error\":\"io.drivebridge.Control.Busy\"}");
	answer(fake, "{\"parameters\":{\"number\":1}}");
	(void)shutdown(fake->connection, SHUT_RDWR);
	assert_int_equal(db_client_handle(fake->client), -1);
	assert_string_equal(heard[2].name, DB_CLIENT_LOST);
}

static void test_who_does_not_answer_in_time_may_answer_later(void **state)
{
	struct fake *fake = *state;
	json_t *got = NULL;

	assert_int_equal(db_client_call(fake->client, "Slow", NULL, 20, &got, &fake->error), -1);
	assert_string_equal(fake->error.name, DB_CLIENT_TIMEOUT);
	assert_non_null(strstr(fake->error.text, "20 ms"));
	answer(fake, "{\"parameters\":{\"number\":1}}");
	answer(fake, "{\"parameters\":{\"number\":2}}");
	assert_int_equal(db_client_call(fake->client, "Next", NULL, 1000, &got, &fake->error), 0);
	assert_int_equal(json_integer_value(json_object_get(got, "number")), 2);
	json_decref(got);
}

static void test_a_lost_connection_is_told_to_all_who_wait(void **state)
{
	struct fake *fake = *state;
	struct heard one = { .answers = 0 };
	struct heard two = { .answers = 0 };
	json_t *got = NULL;

	assert_int_equal(db_client_send(fake->client, "A", NULL, false, hear, &one), 0);
	assert_int_equal(db_client_send(fake->client, "B", NULL, true, hear, &two), 0);
	/* The first is answered, of the second only a part comes. */
	answer(fake, "{\"parameters\":{\"number\":1}}");
	assert_int_equal(write(fake->connection, "{\"para", 6), 6);
	(void)close(fake->connection);
	fake->connection = -1;
	assert_int_equal(db_client_handle(fake->client), -1);
	assert_int_equal(one.errors, 0);
	assert_int_equal(two.errors, 1);
	assert_string_equal(two.name, DB_CLIENT_LOST);
	/* And to who comes later. */
	assert_int_equal(db_client_send(fake->client, "C", NULL, false, hear, &one), -1);
	assert_int_equal(db_client_call(fake->client, "C", NULL, 1000, &got, &fake->error), -1);
	assert_string_equal(fake->error.name, DB_CLIENT_LOST);
}

static void test_answers_that_are_none_end_the_connection(void **state)
{
	static const char *const wrong[] = { "hello", "[1]", "{\"error\":3}", "{\"parameters\":[]}",
		                             "{\"parameters\":\"x\"}" };
	struct fake *fake = *state;
	struct heard heard;

	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		heard = (struct heard){ .answers = 0 };
		assert_int_equal(db_client_send(fake->client, "A", NULL, false, hear, &heard), 0);
		answer(fake, wrong[i]);
		assert_int_equal(db_client_handle(fake->client), -1);
		assert_int_equal(heard.errors, 1);
		assert_string_equal(heard.name, DB_CLIENT_BAD_ANSWER);
		(void)close(fake->connection);
		db_client_close(fake->client);
		assert_int_equal(db_client_open(fake->path, &fake->client, &fake->error), 0);
		fake->connection = accept(fake->listener, NULL, NULL);
	}
	/* An answer that nobody has asked for. */
	answer(fake, "{}");
	assert_int_equal(db_client_handle(fake->client), -1);
}

static void test_an_answer_without_end_is_given_up(void **state)
{
	struct fake *fake = *state;
	struct heard heard = { .answers = 0 };
	char bytes[4096];
	size_t sent = 0;

	memset(bytes, ' ', sizeof(bytes));
	assert_int_equal(db_client_send(fake->client, "A", NULL, false, hear, &heard), 0);
	while (heard.errors == 0 && sent < (size_t)64 * 1024 * 1024) {
		if (send(fake->connection, bytes, sizeof(bytes), MSG_DONTWAIT | MSG_NOSIGNAL) > 0)
			sent += sizeof(bytes);
		(void)db_client_handle(fake->client);
	}
	assert_int_equal(heard.errors, 1);
	assert_string_equal(heard.text, "the answer is too long");
	assert_true(sent < (size_t)32 * 1024 * 1024);
}

static void test_what_cannot_be_sent_at_once_waits(void **state)
{
	struct fake *fake = *state;
	struct heard heard = { .answers = 0 };
	char *long_text = calloc(1, 100001);
	char bytes[65536];
	size_t zeros = 0;

	assert_non_null(long_text);
	memset(long_text, 'x', 100000);
	for (unsigned i = 0; i < 20; i++)
		assert_int_equal(db_client_send(fake->client, "A",
		                                json_pack("{s:s}", "t", long_text), false, hear,
		                                &heard),
		                 0);
	assert_int_equal(db_client_poll_fd(fake->client).events, POLLIN | POLLOUT);
	while (zeros < 20) {
		ssize_t count = recv(fake->connection, bytes, sizeof(bytes), MSG_DONTWAIT);

		for (ssize_t i = 0; i < count; i++)
			zeros += bytes[i] == '\0' ? 1 : 0;
		assert_int_equal(db_client_handle(fake->client), 0);
	}
	assert_int_equal(db_client_poll_fd(fake->client).events, POLLIN);
	free(long_text);
}

static void test_who_cannot_be_reached_is_named_with_what_to_do(void **state)
{
	struct fake *fake = *state;
	struct db_client *client = NULL;
	char path[128];
	char too_long[256];

	(void)snprintf(path, sizeof(path), "%s/nothing", fake->folder);
	assert_int_equal(db_client_open(path, &client, &fake->error), -1);
	assert_null(client);
	assert_string_equal(fake->error.name, DB_CLIENT_UNREACHABLE);
	assert_non_null(strstr(fake->error.text, "is the service running?"));

	memset(too_long, 'x', sizeof(too_long) - 1);
	too_long[sizeof(too_long) - 1] = '\0';
	assert_int_equal(db_client_open(too_long, &client, &fake->error), -1);

	/* Root may do everything. */
	if (geteuid() != 0) {
		assert_int_equal(chmod(fake->path, 0), 0);
		assert_int_equal(db_client_open(fake->path, &client, &fake->error), -1);
		assert_non_null(strstr(fake->error.text, "group drivebridge"));
		assert_int_equal(chmod(fake->path, 0600), 0);
	}
	(void)close(fake->listener);
	fake->listener = -1;
	assert_int_equal(db_client_open(fake->path, &client, &fake->error), -1);
	assert_non_null(strstr(fake->error.text, "nobody listens"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_a_call_is_answered, open_fake, close_fake),
		cmocka_unit_test_setup_teardown(test_answers_come_in_the_order_of_calls, open_fake,
		                                close_fake),
		cmocka_unit_test_setup_teardown(test_a_stream_goes_on_until_it_ends, open_fake,
		                                close_fake),
		cmocka_unit_test_setup_teardown(test_errors_have_names_parameters_and_words,
		                                open_fake, close_fake),
		cmocka_unit_test_setup_teardown(test_no_room_for_a_session_is_told_to_all_calls,
		                                open_fake, close_fake),
		cmocka_unit_test_setup_teardown(test_busy_is_no_reason_for_a_later_loss, open_fake,
		                                close_fake),
		cmocka_unit_test_setup_teardown(test_who_does_not_answer_in_time_may_answer_later,
		                                open_fake, close_fake),
		cmocka_unit_test_setup_teardown(test_a_lost_connection_is_told_to_all_who_wait,
		                                open_fake, close_fake),
		cmocka_unit_test_setup_teardown(test_answers_that_are_none_end_the_connection,
		                                open_fake, close_fake),
		cmocka_unit_test_setup_teardown(test_an_answer_without_end_is_given_up, open_fake,
		                                close_fake),
		cmocka_unit_test_setup_teardown(test_what_cannot_be_sent_at_once_waits, open_fake,
		                                close_fake),
		cmocka_unit_test_setup_teardown(test_who_cannot_be_reached_is_named_with_what_to_do,
		                                open_fake, close_fake),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
