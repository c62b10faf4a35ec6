/* SPDX-License-Identifier: Apache-2.0 */
/* Which drives must stand, from one run of the service to the next, and in a file in between. */
#include "service/service_private.h"

#include "fakes/registers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

struct world {
	char folder[64];
	char socket[96];
	char file[128];
	struct fake_registers fake;
	struct service service;
	struct plant plant;
	struct edition edition;
	struct plant_bus bus;
	struct plant_drive drives[2];
	struct plant_drive *list[2];
};

/* The drives at addresses 5 and 6 of one bus, which are numbers 0 and 1 of this run. */
static void begin_run(struct world *world)
{
	struct service *service = &world->service;

	fake_registers_init(&world->fake, 1, 2);
	world->fake.buses[0].device = (char *)"/dev/serial/by-id/usb-A B";
	fake_registers_open(&world->fake);
	world->fake.config.control.socket = world->socket;
	world->edition = (struct edition){ .config = &world->fake.config };
	world->bus = (struct plant_bus){ .config = &world->fake.buses[0] };
	for (unsigned i = 0; i < 2; i++) {
		world->drives[i] = (struct plant_drive){ .config = &world->fake.drives[i],
			                                 .bus = &world->bus,
			                                 .axis = world->fake.axes[i],
			                                 .number = (uint16_t)i };
		world->list[i] = &world->drives[i];
	}
	world->plant = (struct plant){ .edition = &world->edition,
		                       .drives = world->list,
		                       .drive_count = 2 };
	*service = (struct service){ .plant = &world->plant, .registers = world->fake.registers };
	assert_int_equal(sd_event_new(&service->loop), 0);
}

static void look_from_the_start(struct world *world)
{
	assert_int_equal(must_stand_begin(&world->service), 0);
}

static void end_run(struct world *world)
{
	must_stand_end(&world->service);
	assert_null(world->service.must_stand);
	sd_event_unref(world->service.loop);
	fake_registers_close(&world->fake);
}

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof(*world));

	assert_non_null(world);
	strcpy(world->folder, "/tmp/must-stand-XXXXXX");
	assert_non_null(mkdtemp(world->folder));
	snprintf(world->socket, sizeof(world->socket), "%s/control", world->folder);
	snprintf(world->file, sizeof(world->file), "%s.must-stand", world->socket);
	begin_run(world);
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	end_run(world);
	unlink(world->file);
	assert_int_equal(rmdir(world->folder), 0);
	free(world);
	return 0;
}

/* What the bus says of a drive. */
static void publish(struct world *world, unsigned drive, enum db_stand_cause cause,
                    enum db_command command, bool seen)
{
	struct db_snapshot snapshot = {
		.feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE, .taken = 1 },
		.must_stand = { .cause = (uint8_t)cause,
		                .command = (uint8_t)command,
		                .seen = seen },
	};

	db_axis_publish(world->fake.axes[drive], &snapshot);
}

/* What is in the file; "" when there is none. */
static const char *written(const struct world *world)
{
	static char text[512];
	FILE *file = fopen(world->file, "r");
	size_t length = file ? fread(text, 1, sizeof(text) - 1, file) : 0;

	text[length] = '\0';
	if (file)
		fclose(file);
	return text;
}

static void write_down(const struct world *world, const char *text)
{
	FILE *file = fopen(world->file, "w");

	assert_non_null(file);
	assert_true(fputs(text, file) >= 0);
	assert_int_equal(fclose(file), 0);
}

#define FIRST "5 0 stop /dev/serial/by-id/usb-A B\n"
#define SECOND "6 0 disable /dev/serial/by-id/usb-A B\n"

/* --- the file --------------------------------------------------------------------------------- */

static void a_drive_that_must_stand_is_in_the_file_until_it_was_seen(void **state)
{
	struct world *world = *state;

	look_from_the_start(world);
	assert_string_equal(written(world), "");
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_STOP, false);
	must_stand_look(&world->service);
	assert_string_equal(written(world), FIRST);
	publish(world, 1, DB_STAND_LIMIT, DB_CMD_DISABLE, false);
	must_stand_look(&world->service);
	assert_string_equal(written(world), FIRST SECOND);
	/* It was read after its stop, and stood. */
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_STOP, true);
	must_stand_look(&world->service);
	assert_string_equal(written(world), SECOND);
	/* A later motion was accepted. */
	publish(world, 1, DB_STAND_FREE, DB_CMD_NONE, false);
	must_stand_look(&world->service);
	assert_int_equal(access(world->file, F_OK), -1);
}

/* A stronger stop for the same drive is another entry. */
static void the_strongest_stop_is_written(void **state)
{
	struct world *world = *state;

	look_from_the_start(world);
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_STOP, false);
	must_stand_look(&world->service);
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_QUICK_STOP, false);
	must_stand_look(&world->service);
	assert_string_equal(written(world), "5 0 quick_stop /dev/serial/by-id/usb-A B\n");
}

/* A stop that no bus has yet counts, too. */
static void a_stop_on_its_way_is_written(void **state)
{
	struct world *world = *state;

	look_from_the_start(world);
	publish(world, 0, DB_STAND_FREE, DB_CMD_NONE, false);
	assert_int_equal(fake_put(&world->fake, 1, 100, 2, 0, DB_CMD_STOP), DB_WRITE_LATER);
	must_stand_look(&world->service);
	assert_string_equal(written(world), FIRST);
	fake_complete(&world->fake, 0, DB_RESULT_OK);
	must_stand_look(&world->service);
	assert_string_equal(written(world), "");
}

static void nothing_is_written_without_a_socket(void **state)
{
	struct world *world = *state;

	world->fake.config.control.socket = (char *)DB_NO_SOCKET;
	look_from_the_start(world);
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_STOP, false);
	must_stand_look(&world->service);
	assert_string_equal(written(world), "");
	assert_int_equal(access(DB_NO_SOCKET ".must-stand", F_OK), -1);
}

/* --- the next run ----------------------------------------------------------------------------- */

static void another_run_stops_what_must_stand(void **state)
{
	struct world *world = *state;

	look_from_the_start(world);
	publish(world, 0, DB_STAND_WATCHDOG, DB_CMD_STOP, false);
	publish(world, 1, DB_STAND_CLIENT, DB_CMD_DISABLE, false);
	/* The end of the service looks, too. */
	end_run(world);
	assert_string_equal(written(world), FIRST SECOND);
	begin_run(world);
	publish(world, 0, DB_STAND_FREE, DB_CMD_NONE, false);
	publish(world, 1, DB_STAND_FREE, DB_CMD_NONE, false);
	look_from_the_start(world);
	assert_int_equal(world->fake.submitted, 2);
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(world->fake.requests[i].drive, i);
		assert_int_equal(world->fake.requests[i].command,
		                 i == 0 ? DB_CMD_STOP : DB_CMD_DISABLE);
		assert_int_equal(world->fake.requests[i].cause, DB_STAND_RESTART);
	}
	/* The file is as it was until the bus has it, and nothing is said twice. */
	assert_string_equal(written(world), FIRST SECOND);
	must_stand_look(&world->service);
	assert_int_equal(world->fake.submitted, 2);
	publish(world, 0, DB_STAND_RESTART, DB_CMD_STOP, false);
	fake_complete(&world->fake, 0, DB_RESULT_OK);
	must_stand_look(&world->service);
	assert_string_equal(written(world), FIRST SECOND);
	publish(world, 0, DB_STAND_RESTART, DB_CMD_STOP, true);
	publish(world, 1, DB_STAND_RESTART, DB_CMD_DISABLE, true);
	fake_complete(&world->fake, 1, DB_RESULT_OK);
	must_stand_look(&world->service);
	assert_string_equal(written(world), "");
	assert_int_equal(world->fake.submitted, 2);
}

/* It may come back with a reload: then it is stopped. */
static void a_drive_that_is_not_there_is_kept_in_mind(void **state)
{
	struct world *world = *state;

	write_down(world, SECOND FIRST);
	world->plant.drive_count = 1;
	look_from_the_start(world);
	assert_int_equal(world->fake.submitted, 1);
	fake_complete(&world->fake, 0, DB_RESULT_OK);
	publish(world, 0, DB_STAND_FREE, DB_CMD_NONE, false);
	must_stand_look(&world->service);
	must_stand_look(&world->service);
	assert_string_equal(written(world), SECOND);
	world->plant.drive_count = 2;
	must_stand_look(&world->service);
	assert_int_equal(world->fake.submitted, 2);
	assert_int_equal(world->fake.requests[1].drive, 1);
	assert_int_equal(world->fake.requests[1].command, DB_CMD_DISABLE);
}

/* The same address at another port, another address, another axis: another drive. */
static void a_drive_is_known_by_its_place(void **state)
{
	struct world *world = *state;

	write_down(world, "5 0 stop /dev/serial/by-id/usb-A\n"
	                  "7 0 stop /dev/serial/by-id/usb-A B\n"
	                  "5 1 stop /dev/serial/by-id/usb-A B\n");
	look_from_the_start(world);
	assert_int_equal(world->fake.submitted, 0);
	assert_string_equal(written(world), "5 0 stop /dev/serial/by-id/usb-A\n"
	                                    "7 0 stop /dev/serial/by-id/usb-A B\n"
	                                    "5 1 stop /dev/serial/by-id/usb-A B\n");
}

/* What is wrong in the file takes nothing from what is right in it. */
static void a_line_that_makes_no_sense_hides_no_other(void **state)
{
	struct world *world = *state;

	write_down(world, "\n"
	                  "nonsense\n"
	                  "5 0 stop\n"
	                  "5 0 move_absolute /dev/serial/by-id/usb-A B\n"
	                  "5 0 stops /dev/serial/by-id/usb-A B\n" SECOND);
	look_from_the_start(world);
	assert_int_equal(world->fake.submitted, 1);
	assert_int_equal(world->fake.requests[0].drive, 1);
	assert_int_equal(world->fake.requests[0].command, DB_CMD_DISABLE);
	assert_string_equal(written(world), SECOND);
}

/* --- times ------------------------------------------------------------------------------------ */

/* Without being told, as long as a drive must stand. */
static void what_must_stand_is_looked_at_again_and_again(void **state)
{
	struct world *world = *state;

	look_from_the_start(world);
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_STOP, false);
	must_stand_look_soon(&world->service);
	assert_string_equal(written(world), "");
	assert_true(sd_event_run(world->service.loop, UINT64_MAX) > 0);
	assert_string_equal(written(world), FIRST);
	publish(world, 0, DB_STAND_CLIENT, DB_CMD_STOP, true);
	assert_true(sd_event_run(world->service.loop, UINT64_MAX) > 0);
	assert_string_equal(written(world), "");
	/* Now nothing is left to do. */
	assert_int_equal(sd_event_run(world->service.loop, 200000), 0);
}

int main(void)
{
#define TEST_OF_WORLD(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)
	const struct CMUnitTest tests[] = {
		TEST_OF_WORLD(a_drive_that_must_stand_is_in_the_file_until_it_was_seen),
		TEST_OF_WORLD(the_strongest_stop_is_written),
		TEST_OF_WORLD(a_stop_on_its_way_is_written),
		TEST_OF_WORLD(nothing_is_written_without_a_socket),
		TEST_OF_WORLD(another_run_stops_what_must_stand),
		TEST_OF_WORLD(a_drive_that_is_not_there_is_kept_in_mind),
		TEST_OF_WORLD(a_drive_is_known_by_its_place),
		TEST_OF_WORLD(a_line_that_makes_no_sense_hides_no_other),
		TEST_OF_WORLD(what_must_stand_is_looked_at_again_and_again),
	};

	return cmocka_run_group_tests_name("service: drives that must stand", tests, NULL, NULL);
}
