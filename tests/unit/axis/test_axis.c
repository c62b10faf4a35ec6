/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/axis.h"
#include "drivebridge/command.h"

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static void starts_offline_and_empty(void **state)
{
	struct db_axis *axis = db_axis_new();
	struct db_snapshot snapshot;
	struct db_nameplate plate;

	(void)state;
	memset(&snapshot, 0xFF, sizeof snapshot);
	memset(&plate, 0xFF, sizeof plate);
	db_axis_read(axis, &snapshot);
	db_axis_read_nameplate(axis, &plate);
	assert_int_equal(snapshot.feedback.state, DB_AXIS_OFFLINE);
	assert_int_equal(snapshot.feedback.taken, 0);
	assert_int_equal(plate.valid, 0);
	assert_int_equal(plate.identity[0], 0);
	db_axis_free(axis);
}

static void what_is_published_is_read(void **state)
{
	struct db_axis *axis = db_axis_new();
	struct db_snapshot in;
	struct db_snapshot out;
	struct db_nameplate plate_in;
	struct db_nameplate plate_out;

	(void)state;
	memset(&in, 0x5A, sizeof in);
	memset(&plate_in, 0x3C, sizeof plate_in);
	db_axis_publish(axis, &in);
	db_axis_publish_nameplate(axis, &plate_in);
	db_axis_read(axis, &out);
	db_axis_read_nameplate(axis, &plate_out);
	assert_memory_equal(&in, &out, sizeof in);
	assert_memory_equal(&plate_in, &plate_out, sizeof plate_in);
	db_axis_free(axis);
}

#define PUBLICATIONS 20000

struct race {
	struct db_axis *axis;
	atomic_bool done;
};

/* Every byte of a publication is the same, so that a mixture of two shows. */
static void *publish_many(void *context)
{
	struct race *race = context;
	struct db_snapshot snapshot;
	struct db_nameplate plate;

	for (unsigned i = 1; i <= PUBLICATIONS; i++) {
		memset(&snapshot, (int)(i & 0xFF), sizeof snapshot);
		memset(&plate, (int)(i & 0xFF), sizeof plate);
		db_axis_publish(race->axis, &snapshot);
		db_axis_publish_nameplate(race->axis, &plate);
	}
	atomic_store(&race->done, true);
	return NULL;
}

static unsigned differing_bytes(const void *object, size_t size)
{
	const unsigned char *bytes = object;
	unsigned differing = 0;

	for (size_t i = 1; i < size; i++)
		differing += bytes[i] != bytes[0];
	return differing;
}

static void never_tears(void **state)
{
	struct race race = { .axis = db_axis_new() };
	struct db_snapshot snapshot;
	struct db_nameplate plate;
	unsigned torn = 0;
	pthread_t writer;

	(void)state;
	assert_int_equal(pthread_create(&writer, NULL, publish_many, &race), 0);
	while (!atomic_load(&race.done)) {
		db_axis_read(race.axis, &snapshot);
		db_axis_read_nameplate(race.axis, &plate);
		torn += differing_bytes(&snapshot, sizeof snapshot);
		torn += differing_bytes(&plate, sizeof plate);
	}
	pthread_join(writer, NULL);
	assert_int_equal(torn, 0);
	db_axis_read(race.axis, &snapshot);
	assert_int_equal(*(unsigned char *)&snapshot, PUBLICATIONS & 0xFF);
	db_axis_free(race.axis);
}

static void names(void **state)
{
	(void)state;
	assert_string_equal(db_axis_state_name(DB_AXIS_OFFLINE), "Offline");
	assert_string_equal(db_axis_state_name(DB_AXIS_ERROR_STOP), "ErrorStop");
	assert_string_equal(db_axis_state_name(DB_AXIS_STATE_COUNT), "unknown");
	assert_string_equal(db_error_name(DB_ERROR_NONE), "none");
	assert_string_equal(db_error_name(DB_ERROR_VOLTAGE), "voltage");
	assert_string_equal(db_error_name(DB_ERROR_RUNS_ON), "runs_on");
	assert_string_equal(db_error_name(5), "unknown");
	assert_string_equal(db_error_name(UINT16_MAX), "unknown");
	assert_string_equal(db_status_bit_name(0), "online");
	assert_int_equal(DB_STATUS_MUST_STAND, 1u << (DB_STATUS_BIT_COUNT - 1));
	assert_string_equal(db_status_bit_name(DB_STATUS_BIT_COUNT - 1), "must_stand");
	assert_string_equal(db_status_bit_name(DB_STATUS_BIT_COUNT), "unknown");
}

static void kinds_of_commands(void **state)
{
	static const enum db_command motions[] = { DB_CMD_MOVE_VELOCITY,    DB_CMD_MOVE_ABSOLUTE,
		                                   DB_CMD_MOVE_RELATIVE,    DB_CMD_HOME,
		                                   DB_CMD_MOVE_PRESET,      DB_CMD_SHAKE_START,
		                                   DB_CMD_SHAKE_START_TIME, DB_CMD_MOVE_CURRENT,
		                                   DB_CMD_SYNC_START,       DB_CMD_JOG_POSITIVE,
		                                   DB_CMD_JOG_NEGATIVE,     DB_CMD_START_PROGRAM,
		                                   DB_CMD_CONTINUE_PROGRAM };
	unsigned motion_count = 0;
	unsigned stop_count = 0;

	(void)state;
	assert_true(db_command_is_stop(DB_CMD_STOP));
	assert_true(db_command_is_stop(DB_CMD_QUICK_STOP));
	assert_true(db_command_is_stop(DB_CMD_DISABLE));
	for (size_t i = 0; i < sizeof motions / sizeof motions[0]; i++)
		assert_true(db_command_is_motion(motions[i]));
	for (unsigned code = 0; code < DB_CMD_LIMIT; code++) {
		motion_count += db_command_is_motion((enum db_command)code);
		stop_count += db_command_is_stop((enum db_command)code);
	}
	assert_int_equal(motion_count, sizeof motions / sizeof motions[0]);
	assert_int_equal(stop_count, 3);
}

static void what_ends_a_motion(void **state)
{
	static const enum db_command stays[] = { DB_CMD_NONE,         DB_CMD_ENABLE,
		                                 DB_CMD_SET_POSITION, DB_CMD_CLEAR_FAULT,
		                                 DB_CMD_SET_OUTPUT,   DB_CMD_READ_PARAMETERS,
		                                 DB_CMD_END_PROGRAM };

	(void)state;
	for (unsigned code = 0; code < DB_CMD_LIMIT; code++) {
		enum db_command command = (enum db_command)code;

		if (db_command_is_motion(command) || db_command_is_stop(command))
			assert_true(db_command_ends_motion(command));
	}
	assert_true(db_command_ends_motion(DB_CMD_HOME_STOP));
	assert_true(db_command_ends_motion(DB_CMD_SHAKE_STOP));
	for (size_t i = 0; i < sizeof stays / sizeof stays[0]; i++)
		assert_false(db_command_ends_motion(stays[i]));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(starts_offline_and_empty),
		cmocka_unit_test(what_is_published_is_read),
		cmocka_unit_test(never_tears),
		cmocka_unit_test(names),
		cmocka_unit_test(kinds_of_commands),
		cmocka_unit_test(what_ends_a_motion),
	};

	return cmocka_run_group_tests_name("axis", tests, NULL, NULL);
}
