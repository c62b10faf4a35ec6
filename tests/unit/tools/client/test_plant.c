/* SPDX-License-Identifier: Apache-2.0 */
/* The plant in front of a service with two drives, in the same loop. */
#include "client/plant.h"

#include "client/clock.h"
#include "words/value.h"

#include <errno.h>
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

#define CONNECTIONS_MAX 16

struct world {
	char folder[64];
	struct sockaddr_un address;
	int listener;
	int connections[CONNECTIONS_MAX];
	size_t count;
	sd_event *loop;
	struct db_plant *plant;
	const char *drives; /* the answer of Describe */
	const char *silent; /* a method that is not answered; "": none */
	unsigned found;
	unsigned lost;
	unsigned described;
	unsigned samples;
	unsigned events;
	unsigned figures;
	unsigned troubles;
	unsigned asked; /* calls of Registers and Commands */
	bool shared;    /* the registers of both drives are one object */
	bool refuses;   /* the owner cannot use what was found */
	char names[64];
};

static void take_plant(void *context, json_t *description, const struct db_plant_drive *drives,
                       size_t count)
{
	struct world *world = context;

	world->found++;
	world->names[0] = '\0';
	for (size_t i = 0; i < count; i++) {
		(void)strcat(world->names, " ");
		(void)strcat(world->names, db_words_text(drives[i].description, "name"));
	}
	world->shared = count == 2 && drives[0].registers == drives[1].registers;
	assert_non_null(description);
	if (world->refuses)
		db_plant_fail(world->plant, "it is not what it was expected to be");
}

static void lose_plant(void *context)
{
	((struct world *)context)->lost++;
}

static void take_description(void *context, json_t *description)
{
	(void)description;
	((struct world *)context)->described++;
}

static void take_sample(void *context, const json_t *sample, int64_t us)
{
	assert_string_equal(db_words_text(sample, "drive"), "lift");
	assert_int_equal(us, 77);
	((struct world *)context)->samples++;
}

static void take_event(void *context, json_t *event)
{
	(void)event;
	((struct world *)context)->events++;
}

static void take_figures(void *context, json_t *buses)
{
	assert_true(json_is_object(buses));
	((struct world *)context)->figures++;
}

static void take_troubles(void *context, const struct db_client_troubles *troubles,
                          const json_t *news)
{
	(void)news;
	assert_true(troubles->well);
	((struct world *)context)->troubles++;
}

static const struct db_plant_ops ops = {
	.found = take_plant,
	.lost = lose_plant,
	.described = take_description,
	.sample = take_sample,
	.event = take_event,
	.figures = take_figures,
	.troubles = take_troubles,
};

/* What the service answers to a call; NULL: nothing yet. */
static const char *answer_of(struct world *world, const json_t *call)
{
	const char *method = strrchr(db_words_text(call, "method"), '.') + 1;

	if (strcmp(method, world->silent) == 0)
		return NULL;
	if (strcmp(method, "Describe") == 0)
		return world->drives;
	world->asked += strcmp(method, "Registers") == 0 || strcmp(method, "Commands") == 0;
	if (strcmp(method, "Registers") == 0)
		return "{\"parameters\":{\"registers\":[{\"name\":\"position\"}]}}";
	if (strcmp(method, "Commands") == 0)
		return "{\"parameters\":{\"commands\":[{\"name\":\"stop\",\"stops\":true},"
		       "{\"name\":\"disable\",\"stops\":true},{\"name\":\"enable\","
		       "\"stops\":false}]}}";
	if (strcmp(method, "Figures") == 0)
		return "{\"parameters\":{\"buses\":{}}}";
	if (strcmp(method, "Events") == 0)
		return "{\"parameters\":{\"events\":[{\"number\":1,\"time_us\":1}]},"
		       "\"continues\":true}";
	if (strcmp(method, "Troubles") == 0)
		return "{\"parameters\":{\"drives\":[],\"buses\":[],\"well\":true},"
		       "\"continues\":true}";
	if (strcmp(method, "Subscribe") == 0)
		return "{\"parameters\":{\"time_us\":77,\"samples\":[{\"drive\":\"lift\"}]},"
		       "\"continues\":true}";
	fail_msg("nobody has to call %s", method);
	return NULL;
}

/* Answers what was called. True: there was something. */
static bool serve(struct world *world)
{
	bool any = false;
	char text[4096];

	for (int fd; (fd = accept4(world->listener, NULL, NULL, SOCK_NONBLOCK)) >= 0;) {
		assert_true(world->count < CONNECTIONS_MAX);
		world->connections[world->count++] = fd;
	}
	for (size_t i = 0; i < world->count; i++) {
		ssize_t size = read(world->connections[i], text, sizeof(text));

		for (ssize_t at = 0; at < size; at += (ssize_t)strlen(text + at) + 1) {
			json_t *call = json_loads(text + at, 0, NULL);
			const char *answer = answer_of(world, call);
			size_t length = answer ? strlen(answer) + 1 : 0;

			assert_int_equal(write(world->connections[i], answer, length), length);
			json_decref(call);
			any = true;
		}
	}
	return any;
}

/* Until there is nothing to do; `ahead`: at a later time. */
static void go_on(struct world *world, db_time ahead)
{
	int result;

	do {
		(void)db_plant_tend(world->plant, db_client_now() + ahead);
		result = sd_event_run(world->loop, 0);
	} while (serve(world) || result > 0);
	(void)db_plant_tend(world->plant, db_client_now() + ahead);
}

static void cut(struct world *world)
{
	for (size_t i = 0; i < world->count; i++)
		(void)close(world->connections[i]);
	world->count = 0;
}

#define DRIVES(list) "{\"parameters\":{\"drives\":[" list "],\"buses\":[]}}"
#define LIFT_AND_BELT DRIVES("{\"name\":\"lift\"},{\"name\":\"belt\"}")

static int open_world(void **state)
{
	const struct db_plant_wishes wishes = {
		.registers = true,
		.events = true,
		.troubles = true,
		.interval = 10 * DB_NS_PER_S,
	};
	struct db_plant_wishes own = wishes;
	struct world *world = calloc(1, sizeof(*world));

	assert_non_null(world);
	(void)snprintf(world->folder, sizeof(world->folder), "/tmp/drivebridge-plant-XXXXXX");
	assert_non_null(mkdtemp(world->folder));
	world->address.sun_family = AF_UNIX;
	(void)snprintf(world->address.sun_path, sizeof(world->address.sun_path), "%s/control",
	               world->folder);
	world->listener = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
	assert_int_equal(
		bind(world->listener, (struct sockaddr *)&world->address, sizeof(world->address)),
		0);
	assert_int_equal(listen(world->listener, CONNECTIONS_MAX), 0);
	world->drives = LIFT_AND_BELT;
	world->silent = "";
	assert_true(sd_event_new(&world->loop) >= 0);
	own.socket = world->address.sun_path;
	world->plant = db_plant_new(world->loop, &own, &ops, world);
	assert_non_null(world->plant);
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	db_plant_free(world->plant);
	cut(world);
	(void)sd_event_unref(world->loop);
	(void)close(world->listener);
	(void)unlink(world->address.sun_path);
	(void)rmdir(world->folder);
	free(world);
	return 0;
}

static void all_is_read_and_followed(void **state)
{
	struct world *world = *state;
	json_t *names = json_pack("[s]", "position");

	assert_false(db_plant_is_there(world->plant));
	assert_null(db_plant_reader(world->plant));
	go_on(world, 0);
	assert_int_equal(world->found, 1);
	assert_string_equal(world->names, " lift belt");
	assert_int_equal(world->asked, 4);
	assert_true(world->shared);
	assert_true(db_plant_is_there(world->plant));
	assert_non_null(db_plant_reader(world->plant));
	/* It happened before this program began. */
	assert_int_equal(world->events, 0);
	assert_int_equal(world->troubles, 1);
	assert_int_equal(world->figures, 1);
	assert_int_equal(world->described, 1);
	db_plant_subscribe(world->plant, NULL, names, 100, false);
	go_on(world, 0);
	assert_int_equal(world->samples, 1);
	db_plant_subscribe(world->plant, NULL, NULL, 100, false);
	go_on(world, 0);
	assert_int_equal(world->samples, 1);
	assert_int_equal(world->lost, 0);
	json_decref(names);
}

static void the_service_tells_what_stops(void **state)
{
	struct world *world = *state;

	assert_false(db_plant_is_stop(world->plant, "stop"));
	go_on(world, 0);
	assert_true(db_plant_is_stop(world->plant, "stop"));
	assert_true(db_plant_is_stop(world->plant, "disable"));
	assert_false(db_plant_is_stop(world->plant, "enable"));
	assert_false(db_plant_is_stop(world->plant, ""));
	assert_int_equal(json_object_size(db_plant_stops(world->plant)), 2);
	cut(world);
	go_on(world, 0);
	assert_int_equal(world->lost, 1);
	assert_true(db_plant_is_stop(world->plant, "stop"));
}

static void a_lost_service_is_found_again(void **state)
{
	struct world *world = *state;

	go_on(world, 0);
	cut(world);
	go_on(world, 0);
	assert_int_equal(world->lost, 1);
	assert_false(db_plant_is_there(world->plant));
	/* Not before a second has passed. */
	assert_int_equal(world->count, 0);
	go_on(world, 2 * DB_NS_PER_S);
	assert_int_equal(world->found, 2);
	assert_int_equal(world->lost, 1);
}

static void other_drives_are_read_anew(void **state)
{
	struct world *world = *state;

	go_on(world, 0);
	world->drives = DRIVES("{\"name\":\"belt\"}");
	db_plant_refresh(world->plant);
	go_on(world, 0);
	assert_int_equal(world->found, 2);
	assert_string_equal(world->names, " belt");
	assert_int_equal(world->lost, 0);
	db_plant_refresh(world->plant);
	go_on(world, 0);
	assert_int_equal(world->found, 2);
}

static void silence_is_a_loss(void **state)
{
	struct world *world = *state;

	go_on(world, 0);
	world->silent = "Describe";
	db_plant_refresh(world->plant);
	assert_false(db_plant_is_late(world->plant, db_client_now()));
	assert_true(db_plant_is_late(world->plant, db_client_now() + 2 * DB_NS_PER_S));
	go_on(world, 5 * DB_NS_PER_S);
	assert_int_equal(world->lost, 0);
	(void)db_plant_tend(world->plant, db_client_now() + 11 * DB_NS_PER_S);
	assert_int_equal(world->lost, 1);
}

static void an_owner_may_give_up(void **state)
{
	struct world *world = *state;

	world->refuses = true;
	go_on(world, 0);
	assert_int_equal(world->found, 1);
	assert_int_equal(world->lost, 1);
	assert_false(db_plant_is_there(world->plant));
	world->refuses = false;
	go_on(world, 2 * DB_NS_PER_S);
	assert_int_equal(world->found, 2);
	assert_true(db_plant_is_there(world->plant));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(all_is_read_and_followed, open_world, close_world),
		cmocka_unit_test_setup_teardown(the_service_tells_what_stops, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(a_lost_service_is_found_again, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(other_drives_are_read_anew, open_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(silence_is_a_loss, open_world, close_world),
		cmocka_unit_test_setup_teardown(an_owner_may_give_up, open_world, close_world),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
