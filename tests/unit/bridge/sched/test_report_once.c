/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the engine reports of a drive: each event once, and again after the drive was offline. One
 * made-up drive, whose state the test sets, and callbacks that count the reports.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define PARAMS 70 /* more bits than one word of a parameter set has */

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	struct db_engine_ops ops;
	struct db_engine *engine;
	struct station *station;
};

static struct db_nameplate plate;
static DB_NAMEPLATE_ROOM(PARAMS) room;
static uint16_t error;         /* the error that the drive shows */
static unsigned told_unusable; /* calls of on_unusable() */
static unsigned told_missing;  /* calls of on_missing_params() */
static unsigned told_raw;      /* calls of on_raw_frame() */
static bool outage;            /* the last event came with an outage */

static const struct db_nameplate *show_nameplate(const struct db_device *device)
{
	(void)device;
	return &plate;
}

static void show_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	feedback->error = error;
}

static void note_event(void *context, const struct db_drive_config *drive, enum db_event event,
                       const struct db_feedback *feedback, const struct db_outage *ended)
{
	struct fake_bus *bus = context;

	(void)drive;
	(void)feedback;
	bus->told[event]++;
	outage = ended != NULL;
}

static void note_unusable(void *context, const struct db_drive_config *drive,
                          const struct db_unusable *unusable)
{
	(void)context;
	(void)drive;
	(void)unusable;
	told_unusable++;
}

static void note_missing(void *context, const struct db_drive_config *drive, const uint64_t *params)
{
	(void)context;
	(void)drive;
	assert_ptr_equal(params, plate.missing);
	told_missing++;
}

static void note_raw_frame(void *context, const struct db_drive_config *drive, bool sent,
                           const uint8_t *bytes, size_t length)
{
	(void)context;
	(void)drive;
	(void)sent;
	(void)bytes;
	(void)length;
	told_raw++;
}

static void open_world(struct world *world)
{
	memset(world, 0, sizeof *world);
	memset(&room, 0, sizeof room);
	plate = (struct db_nameplate){ .generation = 1 };
	DB_NAMEPLATE_INIT(&plate, &room, PARAMS);
	error = DB_ERROR_NONE;
	told_unusable = told_missing = told_raw = 0;
	world->driver = fake_family;
	world->driver.param_count = PARAMS;
	world->driver.nameplate = show_nameplate;
	world->driver.feedback = show_feedback;
	world->bus = fake_bus_new(&world->driver, 1);
	fake_bus_open(world->bus, 1, NULL);
	world->engine = world->bus->engine;
	world->station = world->engine->stations[0];
	world->ops = *world->engine->ops;
	world->ops.on_event = note_event;
	world->ops.on_unusable = note_unusable;
	world->ops.on_missing_params = note_missing;
	world->ops.on_raw_frame = note_raw_frame;
	world->engine->ops = &world->ops;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
	assert_true(fake_is_online(world->bus, 0));
	memset(world->bus->told, 0, sizeof world->bus->told);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
}

static void show(struct world *world, bool online)
{
	world->station->node->online = online;
	engine_publish(world->engine, world->station);
}

/* --- coming and going ------------------------------------------------------------------------- */

static void each_outage_is_told(void **state)
{
	struct world world;

	(void)state;
	open_world(&world);
	for (unsigned i = 1; i <= 2; i++) {
		show(&world, false);
		show(&world, false);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_LOST], i);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_ONLINE], i - 1);
		show(&world, true);
		show(&world, true);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_ONLINE], i);
		assert_true(outage);
	}
	close_world(&world);
}

/* A frame that could not be used says more than DRIVE_LOST, and is reported in its place. */
static void an_unusable_frame_is_reported_instead_of_the_loss(void **state)
{
	struct world world;

	(void)state;
	open_world(&world);
	for (unsigned i = 1; i <= 2; i++) {
		world.station->node->unusable.count = 1;
		show(&world, false);
		assert_int_equal(told_unusable, i);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_LOST], 0);
		engine_report_unusable(world.engine, world.station);
		assert_int_equal(told_unusable, i);
		show(&world, true);
	}
	close_world(&world);
}

/* A fault that is still there after an outage is reported again. The outage alone does not report
 * it as gone. */
static void a_fault_is_reported_after_each_outage(void **state)
{
	struct world world;

	(void)state;
	open_world(&world);
	error = DB_ERROR_DRIVE_FAULT;
	for (unsigned i = 1; i <= 2; i++) {
		show(&world, true);
		show(&world, true);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_FAULT], i);
		show(&world, false);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_FAULT_GONE], 0);
	}
	close_world(&world);
}

/* Where late answers keep a drive from coming online, DRIVE_LATE is reported: DRIVE_LOST must not
 * be reported as well. */
static void late_answers_of_an_offline_drive_are_no_loss(void **state)
{
	static const struct {
		enum db_event event;
		bool online, known;
	} cases[] = {
		{ DB_EVENT_DRIVE_LATE, false, true },
		{ DB_EVENT_DRIVE_LATE, true, false },
		{ DB_EVENT_DRIVE_DEAF, false, false },
		{ DB_EVENT_DRIVE_DEAF, true, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct world world;

		open_world(&world);
		world.station->last_logged.online = cases[i].online;
		engine_report_timing(world.engine, world.station,
		                     &(struct db_engine_timing){ .event = cases[i].event });
		assert_int_equal(world.station->last_logged.missing, cases[i].known);
		world.station->last_logged.online = true;
		close_world(&world);
	}
}

/* --- parameters ------------------------------------------------------------------------------- */

/* Parameters of each word of the set; only after the drive was asked for all; again after an
 * outage. */
static void missing_parameters_are_told_once(void **state)
{
	static const size_t params[] = { 0, 63, 64, PARAMS - 1 };

	(void)state;
	for (size_t i = 0; i < sizeof params / sizeof params[0]; i++) {
		struct world world;

		open_world(&world);
		show(&world, true);
		assert_int_equal(told_missing, 0);
		db_params_add(plate.missing, params[i]);
		world.station->device->identified = false;
		show(&world, true);
		assert_int_equal(told_missing, 0);
		world.station->device->identified = true;
		show(&world, true);
		show(&world, true);
		assert_int_equal(told_missing, 1);
		/* One more parameter is missing: a new report. */
		db_params_add(plate.missing, 8);
		show(&world, true);
		show(&world, true);
		assert_int_equal(told_missing, 2);
		show(&world, false);
		show(&world, true);
		assert_int_equal(told_missing, 3);
		close_world(&world);
	}
}

/* --- the end ---------------------------------------------------------------------------------- */

/* Reported only if the drive has answered before (or the bridge cannot have started it), must stand
 * because the service ends, and has not confirmed the stop. */
static void a_drive_that_does_not_confirm_its_last_stop_is_reported(void **state)
{
	static const struct {
		bool taken, end, open, told;
	} cases[] = {
		{ true, true, true, true },
		{ false, true, true, false },
		{ true, false, true, false },
		{ true, true, false, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct world world;
		struct station *station;

		open_world(&world);
		station = world.station;
		station->snapshot.feedback.taken = cases[i].taken ? world.bus->now : 0;
		station->standing.cause = cases[i].end ? DB_STAND_EXIT : DB_STAND_CLIENT;
		station->standing.kind = cases[i].open ? DB_CMD_STOP : DB_CMD_NONE;
		assert_int_equal(standing_is_open(&station->standing), cases[i].open);
		db_engine_report_unconfirmed(world.engine);
		assert_int_equal(world.bus->told[DB_EVENT_DRIVE_UNCONFIRMED], cases[i].told);
		station->standing.kind = DB_CMD_NONE;
		close_world(&world);
	}
}

/* --- raw frames ------------------------------------------------------------------------------- */

static void only_raw_frames_are_reported_as_raw(void **state)
{
	static const enum db_command commands[] = { DB_CMD_ENABLE, DB_CMD_RAW_FRAME };
	struct world world;

	(void)state;
	open_world(&world);
	for (size_t i = 0; i < 2; i++) {
		fake_post(world.bus, 0, commands[i]);
		fake_pass(world.bus, 50 * MS);
		assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
		/* Once for the frame that was sent, and once for its answer. */
		assert_int_equal(told_raw, 2 * i);
	}
	/* Without a callback the frame is sent all the same. */
	world.ops.on_raw_frame = NULL;
	fake_post(world.bus, 0, DB_CMD_RAW_FRAME);
	fake_pass(world.bus, 50 * MS);
	assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	close_world(&world);
}

/* All callbacks but send() may be null. */
static void an_engine_without_callbacks_reports_nothing(void **state)
{
	struct world world;

	(void)state;
	open_world(&world);
	world.ops = (struct db_engine_ops){ .send = world.ops.send };
	db_params_add(plate.missing, 3);
	show(&world, true);
	world.station->node->unusable.count = 1;
	show(&world, false);
	show(&world, true);
	engine_report_event(world.engine, world.station, DB_EVENT_DRIVE_FAULT);
	engine_report_timing(world.engine, world.station,
	                     &(struct db_engine_timing){ .event = DB_EVENT_DRIVE_LATE });
	assert_true(fake_is_online(world.bus, 0));
	close_world(&world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_outage_is_told),
		cmocka_unit_test(an_unusable_frame_is_reported_instead_of_the_loss),
		cmocka_unit_test(a_fault_is_reported_after_each_outage),
		cmocka_unit_test(late_answers_of_an_offline_drive_are_no_loss),
		cmocka_unit_test(missing_parameters_are_told_once),
		cmocka_unit_test(a_drive_that_does_not_confirm_its_last_stop_is_reported),
		cmocka_unit_test(only_raw_frames_are_reported_as_raw),
		cmocka_unit_test(an_engine_without_callbacks_reports_nothing),
	};

	return cmocka_run_group_tests_name("sched/report_once", tests, NULL, NULL);
}
