/* SPDX-License-Identifier: Apache-2.0 */
/* Lanes in front of a service that takes calls and answers when the test says so. */
#include "client/clock.h"
#include "client/lanes.h"

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

#define LANES 3
#define CONNECTIONS_MAX 8
#define MS DB_NS_PER_MS
#define INTERVAL_MS 500
#define INTERVAL (INTERVAL_MS * MS)

struct world {
	char folder[64];
	struct sockaddr_un address;
	int listener;
	int connections[CONNECTIONS_MAX]; /* in the order of their opening; 0 is kept for stops */
	size_t count;
	sd_event *loop;
	struct db_lanes *lanes;
	struct db_lane *lost;
	char seen[64];
	bool again; /* what `seen` returns */
	char ended[64];
};

static void lose(void *context, struct db_lane *lane)
{
	struct world *world = context;

	world->lost = lane;
}

static bool see(void *context, struct db_lane *lane, const char *drive, const json_t *values)
{
	struct world *world = context;

	assert_non_null(lane->link);
	(void)snprintf(world->seen, sizeof(world->seen), "%s=%lld", drive,
	               (long long)json_integer_value(json_object_get(values, "axis_state")));
	return world->again;
}

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct world *world = data;

	(void)parameters;
	(void)more;
	(void)snprintf(world->ended, sizeof(world->ended), "%s", error ? error->name : "ok");
}

static void make_lanes(struct world *world, db_time interval, bool looks_on)
{
	const struct db_lanes_form form = {
		.socket = world->address.sun_path,
		.most = LANES,
		.stops = 2,
		.interval = interval,
		.lost = looks_on ? lose : NULL,
		.seen = looks_on ? see : NULL,
	};

	db_lanes_free(world->lanes);
	world->lanes = db_lanes_new(world->loop, &form, world);
	assert_non_null(world->lanes);
}

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof(*world));

	assert_non_null(world);
	(void)snprintf(world->folder, sizeof(world->folder), "/tmp/drivebridge-lanes-XXXXXX");
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
	make_lanes(world, INTERVAL, true);
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	db_lanes_free(world->lanes);
	(void)sd_event_unref(world->loop);
	for (size_t i = 0; i < world->count; i++)
		(void)close(world->connections[i]);
	(void)close(world->listener);
	(void)unlink(world->address.sun_path);
	(void)rmdir(world->folder);
	free(world);
	return 0;
}

static void take_connections(struct world *world)
{
	for (int fd; (fd = accept4(world->listener, NULL, NULL, SOCK_NONBLOCK)) >= 0;) {
		assert_true(world->count < CONNECTIONS_MAX);
		world->connections[world->count++] = fd;
	}
}

static struct db_lane *open_lane(struct world *world)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_lane *lane = db_lanes_open(world->lanes, &error);

	take_connections(world);
	if (!lane)
		assert_string_equal(error.name, DB_LANES_FULL);
	db_client_error_clear(&error);
	return lane;
}

/* What has come over a connection since it was looked at last. */
static const char *read_calls(const struct world *world, size_t connection)
{
	static char text[4096];
	ssize_t count = read(world->connections[connection], text, sizeof(text) - 1);

	for (ssize_t i = 0; i < count; i++)
		text[i] = text[i] == '\0' ? '\n' : text[i];
	text[count > 0 ? count : 0] = '\0';
	return text;
}

static size_t count_reads(const struct world *world, size_t connection)
{
	size_t count = 0;

	for (const char *at = read_calls(world, connection); (at = strstr(at, ".Read\"")); at++)
		count++;
	return count;
}

static void serve(struct world *world)
{
	while (sd_event_run(world->loop, 0) > 0)
		;
}

static void answer(struct world *world, size_t connection, const char *text)
{
	ssize_t size = (ssize_t)strlen(text) + 1;

	assert_int_equal(write(world->connections[connection], text, (size_t)size), size);
	serve(world);
}

static void answer_read(struct world *world, size_t connection, int watchdog_ms, int control,
                        int control_ms)
{
	char text[256];

	(void)snprintf(text, sizeof(text),
	               "{\"parameters\":{\"values\":{\"axis_state\":3,\"watchdog_remaining_ms\":%d,"
	               "\"control_request\":%d,\"control_remaining_ms\":%d}}}",
	               watchdog_ms, control, control_ms);
	answer(world, connection, text);
}

#define NEVER (-1)

/* A drive that was commanded long ago, so that only its watchdog or control keeps it going, is read
 * again this long after such an answer. */
static void check_next(struct world *world, struct db_lane *lane, int watchdog_ms, int control,
                       int control_ms, int after_ms)
{
	db_time before;
	db_time due;

	assert_true(db_lane_command(lane, "feeder", db_client_now() - 10 * DB_NS_PER_S));
	db_lane_feed(lane, db_client_now());
	assert_int_equal(count_reads(world, 1), 1);
	before = db_client_now();
	answer_read(world, 1, watchdog_ms, control, control_ms);
	due = db_lanes_due(world->lanes);
	if (after_ms == NEVER) {
		assert_true(due == DB_TIME_NEVER);
	} else {
		assert_true(due >= before + after_ms * MS);
		assert_true(due <= db_client_now() + after_ms * MS);
	}
}

static void their_number_is_limited(void **state)
{
	struct world *world = *state;
	struct db_lane *first = open_lane(world);
	struct db_lane *second = open_lane(world);

	assert_non_null(first);
	assert_non_null(second);
	assert_non_null(open_lane(world));
	assert_null(open_lane(world));
	/* And one that is kept for stops. */
	assert_int_equal(world->count, LANES + 1);
	second->session = 7;
	db_lane_drop(second);
	assert_ptr_not_equal(db_lanes_next(world->lanes, first), second);
	assert_ptr_equal(open_lane(world), second);
	assert_int_equal(second->session, 0);
	assert_ptr_equal(db_lanes_next(world->lanes, first), second);
	assert_true(db_lanes_drop(world->lanes));
	assert_null(db_lanes_next(world->lanes, NULL));
	assert_false(db_lanes_drop(world->lanes));
}

static void a_stop_waits_for_no_lane(void **state)
{
	struct world *world = *state;
	struct db_lane *lane = NULL;

	while ((lane = open_lane(world)))
		assert_int_equal(
			db_link_send(lane->link, "Run", json_object(), false, on_answer, world), 0);
	assert_true(db_stops_send(db_lanes_stops(world->lanes), NULL,
	                          &(struct db_stops_user){ "anna", "" }, "Run",
	                          json_pack("{s:s, s:s}", "drive", "feeder", "command", "stop"),
	                          false, on_answer, world));
	take_connections(world);
	assert_int_equal(world->count, LANES + 2);
	assert_non_null(strstr(read_calls(world, LANES + 1), "\"stop\""));
	assert_null(strstr(read_calls(world, 0), "\"stop\""));
	/* Answered when all is closed, so that nobody waits for it for ever. */
	assert_true(db_lanes_drop(world->lanes));
	assert_string_equal(world->ended, DB_CLIENT_LOST);
}

static void closing_answers_and_dropping_does_not(void **state)
{
	struct world *world = *state;
	struct db_lane *lane = open_lane(world);

	assert_int_equal(db_link_send(lane->link, "Run", json_object(), false, on_answer, world),
	                 0);
	lane->call = malloc(8);
	db_lane_drop(lane);
	assert_string_equal(world->ended, "");
	lane = open_lane(world);
	assert_null(lane->call);
	assert_int_equal(db_link_send(lane->link, "Run", json_object(), false, on_answer, world),
	                 0);
	assert_true(db_lane_command(lane, "feeder", 0));
	*db_lane_note(lane, "feeder") = json_object();
	db_lane_close(lane);
	assert_string_equal(world->ended, DB_CLIENT_LOST);
	assert_null(lane->link);
	assert_null(lane->drives);
	db_lane_close(NULL);
}

/* The owner closes it, after its calls have been answered. */
static void the_owner_of_a_lost_lane_is_told(void **state)
{
	struct world *world = *state;
	struct db_lane *lane = open_lane(world);

	assert_int_equal(db_link_send(lane->link, "Run", json_object(), false, on_answer, world),
	                 0);
	assert_int_equal(shutdown(world->connections[1], SHUT_RDWR), 0);
	serve(world);
	assert_string_equal(world->ended, DB_CLIENT_LOST);
	assert_ptr_equal(world->lost, lane);
	assert_ptr_equal(db_lanes_next(world->lanes, NULL), lane);
	db_lane_close(lane);
	assert_null(db_lanes_next(world->lanes, NULL));
	/* One who does not ask for that has nothing to close. */
	make_lanes(world, INTERVAL, false);
	lane = open_lane(world);
	lane->call = malloc(8);
	assert_int_equal(shutdown(world->connections[world->count - 1], SHUT_RDWR), 0);
	serve(world);
	assert_null(db_lanes_next(world->lanes, NULL));
	assert_null(lane->call);
}

static void a_drive_is_read_in_time_for_its_watchdog(void **state)
{
	struct world *world = *state;
	struct db_lane *lane = open_lane(world);

	/* A quarter of what is left, within the interval. */
	check_next(world, lane, 400, 0, 0, 100);
	check_next(world, lane, 40, 0, 0, 20);
	check_next(world, lane, 60000, 0, 0, INTERVAL_MS);
	/* Control counts for the one that has it. */
	check_next(world, lane, 1600, 1, 400, 100);
	check_next(world, lane, 0, 1, 400, 100);
	check_next(world, lane, 400, 1, 1600, 100);
	check_next(world, lane, 1200, 0, 400, 300);
	/* Silence would end nothing. */
	check_next(world, lane, 0, 0, 400, NEVER);
	check_next(world, lane, 0, 1, 0, NEVER);
	/* Its owner looks on. */
	assert_string_equal(world->seen, "feeder=3");
	world->again = true;
	check_next(world, lane, 0, 0, 0, 20);
}

static void a_command_is_followed_by_reads(void **state)
{
	struct world *world = *state;
	struct db_lane *lane = open_lane(world);

	assert_true(db_lane_command(lane, "feeder", db_client_now()));
	db_lane_feed(lane, db_client_now());
	assert_int_equal(count_reads(world, 1), 1);
	/* One at a time. */
	db_lane_feed(lane, db_client_now() + 60 * DB_NS_PER_S);
	assert_int_equal(count_reads(world, 1), 0);
	assert_true(db_lanes_due(world->lanes) == DB_TIME_NEVER);
	/* Its watchdog may be armed a little later. */
	answer_read(world, 1, 0, 0, 0);
	assert_true(db_lanes_due(world->lanes) != DB_TIME_NEVER);
	/* Not before it is due. */
	db_lane_feed(lane, db_lanes_due(world->lanes) - 1);
	assert_int_equal(count_reads(world, 1), 0);
	db_lane_feed(lane, db_lanes_due(world->lanes));
	assert_int_equal(count_reads(world, 1), 1);
	answer_read(world, 1, 0, 0, 0);
	/* A read would wait for the end of another call. */
	assert_int_equal(db_link_send(lane->link, "Run", json_object(), false, on_answer, world),
	                 0);
	db_lane_feed(lane, db_client_now() + 60 * DB_NS_PER_S);
	assert_int_equal(count_reads(world, 1), 0);
	answer(world, 1, "{}");
	assert_string_equal(world->ended, "ok");
	db_lane_feed(lane, db_client_now() + 60 * DB_NS_PER_S);
	assert_int_equal(count_reads(world, 1), 1);
	/* Reads of other drives are no such call. */
	assert_true(db_lane_command(lane, "lift", db_client_now()));
	db_lane_feed(lane, db_client_now());
	assert_int_equal(count_reads(world, 1), 1);
	assert_int_equal(lane->reads, 2);
}

static void what_is_not_there_is_not_read_again(void **state)
{
	static const char missing[] = "{\"error\":\"io.drivebridge.Control.NoSuchDrive\"}";
	static const char failed[] = "{\"error\":\"io.drivebridge.Control.Busy\"}";
	struct world *world = *state;
	struct db_lane *lane = open_lane(world);
	db_time before = db_client_now() - 10 * DB_NS_PER_S;

	assert_true(db_lane_command(lane, "feeder", before));
	db_lane_feed(lane, db_client_now());
	answer(world, 1, failed);
	assert_true(db_lanes_due(world->lanes) != DB_TIME_NEVER);
	db_lane_feed(lane, db_lanes_due(world->lanes));
	answer(world, 1, missing);
	assert_true(db_lanes_due(world->lanes) == DB_TIME_NEVER);
	/* Until somebody commands it again. */
	assert_true(db_lane_command(lane, "feeder", before));
	assert_true(db_lanes_due(world->lanes) == before);
}

static void without_an_interval_each_sign_of_life_counts(void **state)
{
	struct world *world = *state;
	struct db_lane *lane;

	make_lanes(world, 0, false);
	lane = open_lane(world);
	assert_true(db_lane_command(lane, "feeder", db_client_now() - 10 * DB_NS_PER_S));
	for (unsigned i = 0; i < 3; i++) {
		db_lane_feed(lane, db_client_now());
		assert_int_equal(count_reads(world, world->count - 1), 1);
		answer_read(world, world->count - 1, 0, 0, 0);
	}
}

static void a_lane_remembers_its_drives(void **state)
{
	struct world *world = *state;
	struct db_lane *lane = open_lane(world);
	char name[80];

	memset(name, 'x', sizeof(name));
	name[64] = '\0';
	assert_false(db_lane_command(lane, name, 1));
	name[63] = '\0';
	assert_true(db_lane_command(lane, name, 1));
	assert_null(db_lane_note(lane, "feeder"));
	for (unsigned i = 1; i < 256; i++) {
		(void)snprintf(name, sizeof(name), "drive%u", i);
		assert_true(db_lane_command(lane, name, 2));
		*db_lane_note(lane, name) = json_integer(i);
	}
	assert_int_equal(lane->count, 256);
	assert_false(db_lane_command(lane, "one-more", 2));
	assert_true(db_lane_command(lane, "drive255", 2));
	assert_int_equal(json_integer_value(*db_lane_note(lane, "drive17")), 17);
	assert_true(db_lanes_due(world->lanes) == 1);
	/* All of them. */
	assert_true(db_lane_command(lane, NULL, 5));
	assert_int_equal(lane->count, 256);
	assert_true(db_lanes_due(world->lanes) == 5);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(their_number_is_limited, open_world, close_world),
		cmocka_unit_test_setup_teardown(a_stop_waits_for_no_lane, open_world, close_world),
		cmocka_unit_test_setup_teardown(closing_answers_and_dropping_does_not, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(the_owner_of_a_lost_lane_is_told, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(a_drive_is_read_in_time_for_its_watchdog,
		                                open_world, close_world),
		cmocka_unit_test_setup_teardown(a_command_is_followed_by_reads, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(what_is_not_there_is_not_read_again, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(without_an_interval_each_sign_of_life_counts,
		                                open_world, close_world),
		cmocka_unit_test_setup_teardown(a_lane_remembers_its_drives, open_world,
		                                close_world),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
