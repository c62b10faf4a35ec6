/* SPDX-License-Identifier: Apache-2.0 */
/* Stops in front of a service that takes calls and answers when the test says so. */
#include "client/stops.h"

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

#define PLACES 2
#define CONNECTIONS_MAX 16

struct world {
	char folder[64];
	struct sockaddr_un address;
	int listener;
	int connections[CONNECTIONS_MAX]; /* in the order of their opening */
	size_t count;
	sd_event *loop;
	struct db_stops *stops;
	char ends[256]; /* the answers in their order: " DRIVE=RESULT" */
};

static struct world *now;

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	const char *last = error ? strrchr(error->name, '.') + 1 :
	                           json_string_value(json_object_get(parameters, "result"));
	size_t used = strlen(now->ends);

	assert_false(more);
	(void)snprintf(now->ends + used, sizeof(now->ends) - used, " %s=%s", (const char *)data,
	               last);
}

static bool stop(struct world *world, const char *key, const char *drive)
{
	bool sent = db_stops_send(
		world->stops, key, &(struct db_stops_user){ "anna", "" }, "Run",
		json_pack("{s:s, s:s, s:b}", "drive", drive, "command", "stop", "until_end", 1),
		false, on_answer, (void *)(uintptr_t)drive);

	for (int fd; (fd = accept4(world->listener, NULL, NULL, SOCK_NONBLOCK)) >= 0;) {
		assert_true(world->count < CONNECTIONS_MAX);
		world->connections[world->count++] = fd;
	}
	return sent;
}

/* What has come over a connection. */
static const char *read_calls(const struct world *world, size_t connection)
{
	static char text[4096];
	ssize_t count = read(world->connections[connection], text, sizeof(text) - 1);

	for (ssize_t i = 0; i < count; i++)
		text[i] = text[i] == '\0' ? '\n' : text[i];
	text[count > 0 ? count : 0] = '\0';
	return text;
}

/* The service answers over this connection: first to Introduce. */
static void answer(struct world *world, size_t connection, const char *text)
{
	char whole[256];
	int size = snprintf(whole, sizeof(whole), "{}%c%s", '\0', text) + 1;

	assert_int_equal(write(world->connections[connection], whole, (size_t)size), size);
	while (sd_event_run(world->loop, 0) > 0)
		;
}

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof(*world));

	assert_non_null(world);
	(void)snprintf(world->folder, sizeof(world->folder), "/tmp/drivebridge-stops-XXXXXX");
	assert_non_null(mkdtemp(world->folder));
	world->address.sun_family = AF_UNIX;
	(void)snprintf(world->address.sun_path, sizeof(world->address.sun_path), "%s/control",
	               world->folder);
	world->listener = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
	assert_int_equal(
		bind(world->listener, (struct sockaddr *)&world->address, sizeof(world->address)),
		0);
	assert_int_equal(listen(world->listener, CONNECTIONS_MAX), 0);
	assert_true(sd_event_new(&world->loop) >= 0);
	world->stops = db_stops_new(world->loop, world->address.sun_path, PLACES);
	assert_non_null(world->stops);
	now = world;
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	(void)db_stops_drop(world->stops);
	free(world->stops);
	(void)sd_event_unref(world->loop);
	for (size_t i = 0; i < world->count; i++)
		(void)close(world->connections[i]);
	(void)close(world->listener);
	(void)unlink(world->address.sun_path);
	(void)rmdir(world->folder);
	free(world);
	return 0;
}

static void each_goes_over_a_connection_of_its_own(void **state)
{
	struct world *world = *state;

	assert_true(stop(world, NULL, "lift"));
	assert_true(stop(world, NULL, "belt"));
	assert_int_equal(world->count, 2);
	assert_non_null(strstr(read_calls(world, 0), "\"lift\""));
	assert_non_null(strstr(read_calls(world, 1), "\"belt\""));
	assert_string_equal(world->ends, "");
	answer(world, 1, "{\"parameters\":{\"result\":\"ok\"}}");
	answer(world, 0, "{\"error\":\"io.drivebridge.Control.Refused\",\"parameters\":{}}");
	assert_string_equal(world->ends, " belt=ok lift=Refused");
}

static void the_oldest_gives_its_place(void **state)
{
	struct world *world = *state;

	assert_true(stop(world, NULL, "lift"));
	assert_true(stop(world, NULL, "belt"));
	assert_true(stop(world, NULL, "feeder"));
	assert_string_equal(world->ends, " lift=Pending");
	assert_int_equal(world->count, 3);
	assert_non_null(strstr(read_calls(world, 2), "\"feeder\""));
	assert_true(stop(world, NULL, "press"));
	assert_string_equal(world->ends, " lift=Pending belt=Pending");
}

static void one_of_the_same_key_gives_its_place(void **state)
{
	struct world *world = *state;

	assert_true(stop(world, "1 lift", "lift"));
	assert_true(stop(world, "1 belt", "belt"));
	assert_true(stop(world, "1 belt", "belt"));
	assert_string_equal(world->ends, " belt=Pending");
	answer(world, 0, "{\"parameters\":{\"result\":\"ok\"}}");
	assert_string_equal(world->ends, " belt=Pending lift=ok");
}

static void it_needs_no_room_in_the_service(void **state)
{
	struct world *world = *state;

	db_stops_prepare(world->stops);
	assert_true(stop(world, NULL, "lift"));
	assert_int_equal(world->count, 2);
	answer(world, 1, "{\"error\":\"io.drivebridge.Control.Busy\",\"parameters\":{}}");
	assert_string_equal(world->ends, " lift=Pending");
	/* Nobody is to wait over the connection that is kept open. */
	assert_string_equal(
		read_calls(world, 0),
		"{\"method\":\"io.drivebridge.Control.Introduce\",\"parameters\":{\"user\":"
		"\"anna\"},\"oneway\":true}\n"
		"{\"method\":\"io.drivebridge.Control.Run\",\"parameters\":{\"drive\":\"lift\","
		"\"command\":\"stop\"},\"oneway\":true}\n");
}

static void a_lost_connection_is_told(void **state)
{
	struct world *world = *state;

	assert_true(stop(world, NULL, "lift"));
	(void)close(world->connections[--world->count]);
	while (sd_event_run(world->loop, 0) > 0)
		;
	assert_string_equal(world->ends, " lift=Lost");
	/* It can be sent again, unless there is no service. */
	assert_true(stop(world, NULL, "lift"));
	db_stops_forget(world->stops, "lift");
	assert_true(db_stops_drop(world->stops));
	(void)close(world->listener);
	world->listener = -1;
	(void)unlink(world->address.sun_path);
	assert_false(db_stops_send(world->stops, NULL, &(struct db_stops_user){ "", "" }, "Run",
	                           json_object(), false, on_answer, NULL));
	assert_null(db_stops_link(world->stops, "lift"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(each_goes_over_a_connection_of_its_own, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(the_oldest_gives_its_place, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(one_of_the_same_key_gives_its_place, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(it_needs_no_room_in_the_service, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(a_lost_connection_is_told, open_world, close_world),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
