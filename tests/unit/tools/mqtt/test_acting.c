/* SPDX-License-Identifier: Apache-2.0 */
/* Commands and stops in front of a service that takes calls and never answers. */
#include "mqtt/acting.h"

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

#define DRIVES_MAX 12

struct world {
	char folder[64];
	struct sockaddr_un address;
	int listener;
	sd_event *loop;
	int connections[DRIVES_MAX + 8]; /* in the order of their opening */
	size_t count;
	struct db_mqtt_acting *acting;
	unsigned results;
	unsigned ids;
	char result[32]; /* the last one */
	bool repeated;
};

static void take_result(void *context, const struct db_mqtt_outcome *outcome)
{
	struct world *world = context;

	world->results++;
	world->repeated = outcome->repeated;
	(void)snprintf(world->result, sizeof(world->result), "%s", outcome->result);
}

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof(*world));

	assert_non_null(world);
	(void)snprintf(world->folder, sizeof(world->folder), "/tmp/drivebridge-acting-XXXXXX");
	assert_non_null(mkdtemp(world->folder));
	world->address.sun_family = AF_UNIX;
	(void)snprintf(world->address.sun_path, sizeof(world->address.sun_path), "%s/control",
	               world->folder);
	world->listener = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
	assert_int_equal(
		bind(world->listener, (struct sockaddr *)&world->address, sizeof(world->address)),
		0);
	assert_int_equal(listen(world->listener, DRIVES_MAX + 8), 0);
	assert_true(sd_event_new(&world->loop) >= 0);
	world->acting = db_mqtt_acting_new(world->loop, world->address.sun_path, take_result,
	                                   world);
	assert_non_null(world->acting);
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	db_mqtt_acting_free(world->acting);
	sd_event_unref(world->loop);
	for (size_t i = 0; i < world->count; i++)
		(void)close(world->connections[i]);
	(void)close(world->listener);
	(void)unlink(world->address.sun_path);
	(void)rmdir(world->folder);
	free(world);
	return 0;
}

/* All that has arrived. */
static void serve(struct world *world)
{
	while (sd_event_run(world->loop, 0) > 0)
		;
}

static bool stops(const char *name)
{
	return strcmp(name, "stop") == 0 || strcmp(name, "disable") == 0;
}

static void say_command(struct world *world, unsigned drive, const struct db_mqtt_command *command)
{
	char text[8];

	(void)snprintf(text, sizeof(text), "d%u", drive);
	db_mqtt_acting_run(world->acting, text, command, 500, DB_NS_PER_S);
	for (int fd; (fd = accept4(world->listener, NULL, NULL, SOCK_NONBLOCK)) >= 0;) {
		assert_true(world->count < DRIVES_MAX + 8);
		world->connections[world->count++] = fd;
	}
}

static void say_for(struct world *world, unsigned drive, const char *name, const char *user)
{
	struct db_mqtt_command command = { .name = name, .user = user, .stops = stops(name) };

	(void)snprintf(command.id, sizeof(command.id), "%u", ++world->ids);
	say_command(world, drive, &command);
}

static void say_id(struct world *world, unsigned drive, const char *name, const char *id)
{
	struct db_mqtt_command command = { .name = name, .user = "", .stops = stops(name) };

	(void)snprintf(command.id, sizeof(command.id), "%s", id);
	say_command(world, drive, &command);
}

static void say(struct world *world, unsigned drive, const char *name)
{
	say_for(world, drive, name, "");
}

/* The calls that came over a connection since it was looked at last, behind each other. */
static const char *read_calls(struct world *world, size_t connection)
{
	static char text[4096];
	ssize_t count = read(world->connections[connection], text, sizeof(text) - 1);

	for (ssize_t i = 0; i < count; i++)
		text[i] = text[i] == '\0' ? '\n' : text[i];
	text[count > 0 ? count : 0] = '\0';
	return text;
}

#define STOP(drive)                                                                     \
	"{\"method\":\"io.drivebridge.Control.Run\",\"parameters\":{\"drive\":\"" drive \
	"\",\"command\":\"stop\",\"until_end\":true},\"more\":true}\n"

static void a_stop_waits_for_no_session(void **state)
{
	struct world *world = *state;
	char stop[256];

	for (unsigned drive = 1; drive <= DRIVES_MAX; drive++)
		say(world, drive, "home");
	assert_int_equal(world->count, DRIVES_MAX + 1);
	assert_int_equal(world->results, 0);
	say(world, 13, "home");
	assert_string_equal(world->result, "busy");
	/* One after the other without an answer, of drives that move and of one that has no
	 * session. The oldest one gives its place to the last. */
	for (unsigned drive = 9; drive <= 13; drive++) {
		assert_string_equal(world->result, "busy");
		say(world, drive, "stop");
		(void)snprintf(stop, sizeof(stop), STOP("d%u"), drive);
		assert_int_equal(world->count, DRIVES_MAX + 1 + drive - 8);
		assert_string_equal(read_calls(world, world->count - 1), stop);
	}
	assert_string_equal(world->result, "pending");
	assert_string_equal(read_calls(world, 0), "");
}

static void a_stop_needs_no_room_in_the_service(void **state)
{
	static const char busy[] = "{\"error\":\"io.drivebridge.Control.Busy\",\"parameters\":{}}";
	struct world *world = *state;

	say(world, 1, "home");
	say(world, 1, "stop");
	assert_int_equal(world->count, 3);
	assert_string_equal(read_calls(world, 0), "");
	assert_int_equal(write(world->connections[2], busy, sizeof(busy)), sizeof(busy));
	serve(world);
	assert_string_equal(world->result, "pending");
	assert_non_null(strstr(read_calls(world, 0), "\"stop\""));
	/* What moves is not tried again by itself. */
	assert_int_equal(write(world->connections[1], busy, sizeof(busy)), sizeof(busy));
	serve(world);
	assert_string_equal(world->result, "busy");
	assert_string_equal(read_calls(world, 0), "");
}

#define INTRODUCE(name)                                                    \
	"{\"method\":\"io.drivebridge.Control.Introduce\",\"parameters\":" \
	"{\"user\":\"" name "\"}"

/* Before what he wants, once; also of a stop that finds no session, or no room in the service. */
static void the_service_is_told_who_wants_it(void **state)
{
	static const char busy[] = "{\"error\":\"io.drivebridge.Control.Busy\",\"parameters\":{}}";
	static const char done[] = "{}\0{\"parameters\":{\"result\":\"ok\"}}";
	struct world *world = *state;
	const char *calls;

	say_for(world, 1, "home", "anna");
	calls = read_calls(world, 1);
	assert_memory_equal(calls, INTRODUCE("anna") "}\n", strlen(INTRODUCE("anna") "}\n"));
	assert_non_null(strstr(calls, "\"home\""));
	assert_int_equal(write(world->connections[1], done, sizeof(done)), sizeof(done));
	serve(world);
	assert_string_equal(world->result, "ok");
	say_for(world, 1, "enable", "anna");
	assert_null(strstr(read_calls(world, 1), "Introduce"));
	/* Another one while it is busy: a session of its own, for which there is no room. */
	say_for(world, 1, "stop", "otto");
	assert_int_equal(world->count, 3);
	assert_non_null(strstr(read_calls(world, 2), INTRODUCE("otto")));
	assert_int_equal(write(world->connections[2], busy, sizeof(busy)), sizeof(busy));
	(void)shutdown(world->connections[2], SHUT_RDWR);
	serve(world);
	assert_string_equal(world->result, "pending");
	calls = read_calls(world, 0);
	assert_memory_equal(calls, INTRODUCE("otto") ",\"oneway\":true}\n",
	                    strlen(INTRODUCE("otto") ",\"oneway\":true}\n"));
	assert_non_null(strstr(calls, "\"stop\""));
}

/* Whoever commands after another one neither gets what that one controls, nor keeps going what he moves. */
static void each_has_lanes_of_his_own(void **state)
{
	static const char done[] = "{}\0{\"parameters\":{\"result\":\"ok\"}}";
	struct world *world = *state;

	say_for(world, 1, "move_velocity", "anna");
	assert_int_equal(write(world->connections[1], done, sizeof(done)), sizeof(done));
	serve(world);
	(void)read_calls(world, 1);
	say_for(world, 1, "home", "otto");
	assert_int_equal(world->count, 3);
	assert_string_equal(read_calls(world, 1), "");
	assert_non_null(strstr(read_calls(world, 2), INTRODUCE("otto")));
	assert_int_equal(write(world->connections[2], done, sizeof(done)), sizeof(done));
	serve(world);
	db_mqtt_acting_feed(world->acting, "d1", "otto", 2 * DB_NS_PER_S);
	assert_string_equal(read_calls(world, 1), "");
	assert_non_null(strstr(read_calls(world, 2), "Read"));
	db_mqtt_acting_feed(world->acting, "d1", "anna", 2 * DB_NS_PER_S);
	assert_non_null(strstr(read_calls(world, 1), "Read"));
	assert_string_equal(read_calls(world, 2), "");
	/* When all are taken, one that is not busy is better than none. */
	for (unsigned drive = 2; drive < DRIVES_MAX; drive++)
		say(world, drive, "home");
	assert_int_equal(world->count, DRIVES_MAX + 1);
	say_for(world, 1, "home", "olga");
	assert_int_equal(world->count, DRIVES_MAX + 1);
	say_for(world, DRIVES_MAX, "home", "olga");
	assert_string_equal(world->result, "busy");
}

/* The same id once more: the service is not asked again, and the end is told once for both. */
static void one_that_is_under_way_is_not_begun_again(void **state)
{
	struct world *world = *state;

	say_id(world, 1, "home", "7");
	assert_int_equal(world->results, 0);
	say_id(world, 1, "home", "7");
	assert_string_equal(world->result, "pending");
	assert_true(world->repeated);
	assert_int_equal(world->count, 2);
	assert_non_null(strstr(read_calls(world, 1), "\"id\":\"7\",\"within_ms\":500"));
	say_id(world, 2, "home", "7");
	say_id(world, 1, "home", "8");
	assert_int_equal(world->count, 4);
	/* A stop is one each time, and has no id. */
	say_id(world, 1, "disable", "8");
	assert_int_equal(world->count, 5);
	assert_null(strstr(read_calls(world, 4), "\"id\""));
}

static void a_drive_leaves_sessions_for_others(void **state)
{
	struct world *world = *state;
	char id[8];

	for (unsigned i = 0; i < 100; i++) {
		(void)snprintf(id, sizeof(id), "%u", i);
		say_id(world, 1, "home", id);
	}
	assert_string_equal(world->result, "busy");
	assert_int_equal(world->results, 100 - DRIVES_MAX / 2);
	for (unsigned drive = 2; drive <= 1 + DRIVES_MAX / 2; drive++)
		say_id(world, drive, "home", "1");
	assert_int_equal(world->results, 100 - DRIVES_MAX / 2);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(a_stop_waits_for_no_session, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(a_stop_needs_no_room_in_the_service, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(one_that_is_under_way_is_not_begun_again,
		                                open_world, close_world),
		cmocka_unit_test_setup_teardown(a_drive_leaves_sessions_for_others, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(the_service_is_told_who_wants_it, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(each_has_lanes_of_his_own, open_world, close_world),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
